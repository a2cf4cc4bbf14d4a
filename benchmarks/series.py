"""Lists the measured integrators, ours and the peers', with settings from coarse to fine."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from benchmarks.toolchain import Tools

OURS = "hexapod"
PLANT_LAW, MUJOCO_LAW, DRAKE_LAW = "plant", "mujoco", "drake"  # contact laws


@dataclass(frozen=True, kw_only=True)
class Series:
    """One method of one engine."""

    engine: str
    method: str  # as its driver calls it
    settings: tuple[float, ...]  # step sizes in s or tolerances, coarse to fine
    adaptive: bool
    law: str = PLANT_LAW  # results with an engine's own contact law are judged by its own solution
    every: int = 1  # runs every n-th walk, for slow engines; odd, so that both robots are included
    # method and setting of this engine's converged solution; None: that of its law
    converged: tuple[str, float] | None = None
    quick: bool = False  # measured in a quick run too, in every second setting

    @property
    def name(self) -> str:
        return f"{self.engine} {self.method}"

    @property
    def reference(self) -> tuple[str, str, float]:
        """Engine, method and setting of the converged solution."""
        return (self.engine, *self.converged) if self.converged else REFERENCES[self.law]


TOLERANCES = (
    1.0,
    3e-1,
    2e-1,
    1.5e-1,
    1e-1,
    3e-2,
    2e-2,
    1e-2,
    3e-3,
    2e-3,
    1e-3,
    6e-4,
    4e-4,
    3e-4,
    2e-4,
    1e-4,
    3e-5,
    1e-5,
    1e-6,
    1e-7,
)
EXPLICIT_TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
STEPS = (5e-3, 2.5e-3, 1.25e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4)
PEER_STEPS = (1e-3, 5e-4, 2.5e-4, 1.25e-4, 6.25e-5)
OWN_STEPS = (2e-3, 1e-3, 5e-4)


def ours() -> list[Series]:
    """Returns the series of the plant's own integrators."""
    implicit = [
        Series(engine=OURS, method=name, settings=TOLERANCES, adaptive=True, quick=True)
        for name in ("rosw3", "ros2")
    ]
    explicit = [
        Series(engine=OURS, method=name, settings=EXPLICIT_TOLERANCES, adaptive=True)
        for name in ("dp54",)
    ]
    fixed = [
        Series(engine=OURS, method=f"{name}-fixed", settings=STEPS, adaptive=False)
        for name in ("rosw3", "ros2")
    ]
    return [*implicit, *explicit, *fixed]


def peers() -> list[Series]:
    """Returns the peers' integrators.

    MuJoCo and Pinocchio use the plant's law; MuJoCo also has its own, and Drake only its own.
    """
    return [*_with_plant_law(), *_with_own_law()]


def _with_plant_law() -> list[Series]:
    return [
        Series(engine="mujoco", method="law-RK4", settings=PEER_STEPS, adaptive=False, quick=True),
        Series(
            engine="mujoco",
            method="law-implicitfast",
            settings=PEER_STEPS,
            adaptive=False,
            quick=True,
        ),
        Series(engine="pinocchio", method="rk4", settings=PEER_STEPS[1:], adaptive=False),
        Series(engine="pinocchio", method="semi-implicit", settings=PEER_STEPS, adaptive=False),
    ]


def _with_own_law() -> list[Series]:
    drake = {
        "discrete": (5e-3, 2e-3, 1e-3, 5e-4),
        "cenic": (1e-1, 1e-2, 1e-3),
        "implicit_euler": (1e-1, 1e-2),
        "runge_kutta3": (1e-1, 1e-2),
    }
    return [
        Series(
            engine="mujoco",
            method="own-implicitfast",
            settings=OWN_STEPS,
            adaptive=False,
            law=MUJOCO_LAW,
        ),
        Series(
            engine="mujoco",
            method="own-RK4",
            settings=OWN_STEPS[1:],
            adaptive=False,
            law=MUJOCO_LAW,
        ),
        *(
            Series(
                engine="drake",
                method=method,
                settings=settings,
                adaptive=method != "discrete",
                law=DRAKE_LAW,
                every=5,
                converged=DRAKE_LIMITS.get(method),
            )
            for method, settings in drake.items()
        ),
    ]


# converged solutions by contact law: (engine, method, setting)
REFERENCES = {
    PLANT_LAW: (OURS, "dp54", 1e-9),
    MUJOCO_LAW: ("mujoco", "own-RK4", 6.25e-5),
    DRAKE_LAW: ("drake", "runge_kutta3", 1e-5),
}
# Drake's three plants differ in their friction, so each has its own converged solution
DRAKE_LIMITS = {"cenic": ("cenic", 1e-6), "discrete": ("discrete", 1e-4)}


def command(engine: str, tools: Tools) -> list[str]:
    """Returns the command of an engine's driver, [] if the driver does not exist."""
    if engine == "drake":
        script = Path(__file__).parent / "drake_walk.py"
        return (
            [str(tools.python), str(script)]
            if script.exists() and "drake" not in tools.missing
            else []
        )
    driver = tools.driver("plant" if engine == OURS else engine)
    return [str(driver)] if driver.exists() and engine not in tools.missing else []
