"""Draws the loops of the paper's control: Bode diagram, responses to shifts, and margin over delay.

The diagram shows all eigenloci.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import control
import numpy as np

from hexapod_cosim.controller.design.loci import Response, critical_size
from hexapod_cosim.controller.design.paper import (
    PaperLoops,
    Plants,
    StandingPlant,
    closed_loop,
    shifted,
    weight_share,
)
from hexapod_cosim.controller.figure_style import DPI, PALETTE, SETTINGS, UNDATED, WIDTH
from hexapod_cosim.controller.gains import Gains
from hexapod_cosim.controller.plane import Array
from hexapod_cosim.controller.walk.kinematics import LegSolver
from hexapod_cosim.models import Robot

STEP_TIME = 0.6  # s    shown of a response
SHIFT = 0.001  # m    of the feet
RISE = 0.05  # s    duration of the ramp of a disturbance
MOST_DELAY, DELAYS = 0.05, 21  # s    further delay shown, and in how many points
SMALLEST = 0.03  # 1    size of loci that are drawn
DECIBELS = (-40.0, 10.0)
COLOURS = {"worst": PALETTE[3], "others": "0.75", "asked": PALETTE[0], "without": PALETTE[1]}


def plot_design(robot: Robot, gains: Gains, plants: Plants, directory: str | Path) -> list[Path]:
    """Writes `bode`, `step` and `margins` as SVG and PNG into a folder; returns the paths.

    robot, plants: those that the gains were designed for. Raises OSError.
    """
    from matplotlib import rc_context  # noqa: PLC0415  slow to import

    loops = PaperLoops(robot, plants, gains.requirements, period=gains.period)
    loci = np.concatenate([loops.loci(name, gains.paper) for name in plants])
    loci = loci[np.abs(loci).max(axis=1) > SMALLEST]
    with rc_context(SETTINGS):
        figures = {
            "bode": _bode(loci, loops.omega, gains),
            "step": _step(loops, gains),
            "margins": _margins(loci, loops, gains),
        }
        return [
            path
            for name, figure in figures.items()
            for path in _save(figure, Path(directory), name)
        ]


def _figure(rows: int, columns: int, gains: Gains, **options: Any) -> tuple[Any, Any]:
    # a figure without pyplot: no global state, no display
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(WIDTH, 0.3 + 2.1 * rows))
    figure.suptitle(
        f"{gains.robot}, controller period {1e3 * gains.period:g} ms", fontsize="medium"
    )
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def _save(figure: Any, folder: Path, name: str) -> list[Path]:
    for kind, metadata in UNDATED.items():
        figure.savefig(folder / f"{name}.{kind}", dpi=DPI, metadata=metadata)
    return [folder / f"{name}.{kind}" for kind in UNDATED]


def _legend_below(figure: Any, *of: Any) -> None:
    """Draws one legend below the axes, with the labels of all of them."""
    found = {
        label: line
        for axes in of
        for line, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(list(found.values()), list(found), loc="outside lower center", ncols=len(found))


def _each(loci: Response, draw: Callable[..., Any]) -> None:
    """Draws all loci; the one that comes nearest to -1 is drawn last, on top."""
    worst = int(np.abs(1.0 + loci).min(axis=1).argmin())
    for k, locus in enumerate(loci):
        if k != worst:
            draw(locus, color=COLOURS["others"], lw=0.5, label="_")
    draw(loci[worst], color=COLOURS["worst"], lw=1.4, label="nearest to -1")


def _bode(loci: Response, omega: Array, gains: Gains) -> Any:
    figure, ((size,), (angle,)) = _figure(2, 1, gains, sharex=True)
    needs = gains.requirements
    _each(loci, lambda locus, **how: size.semilogx(omega, 20.0 * np.log10(np.abs(locus)), **how))
    _each(
        loci,
        lambda locus, **how: angle.semilogx(omega, np.degrees(np.unwrap(np.angle(locus))), **how),
    )
    for axes, limit, asked, label in (
        (size, 0.0, -needs.gain_margin, f"gain margin asked: {needs.gain_margin:g} dB"),
        (
            angle,
            -180.0,
            needs.phase_margin - 180.0,
            f"phase margin asked: {needs.phase_margin:g} deg",
        ),
    ):
        axes.axhline(limit, color="k", lw=0.6)
        axes.axhline(asked, color=COLOURS["asked"], ls="--", lw=1.0, label=label)
    size.set(ylabel="gain [dB]", ylim=DECIBELS)
    angle.set(
        xlabel="frequency [rad/s]",
        ylabel="phase [deg]",
        ylim=(-540.0, 180.0),
        yticks=range(-540, 181, 180),
    )
    _legend_below(figure, size, angle)
    return figure


def _nominal(robot: Robot, plants: Plants) -> StandingPlant:
    """Returns the plant on the most legs whose mean load is nearest to a third of the weight."""
    return min(plants.values(), key=lambda p: (-p.standing.sum(), abs(p.load(robot).mean() - 1.0)))


def _splay(robot: Robot, plant: StandingPlant) -> Array:
    """Returns shifts (3 n) of unit length that spread the standing feet, without a common one."""
    feet = LegSolver(robot).forward(plant.angle)[plant.standing]
    outwards = feet[:, :2] / np.linalg.norm(feet[:, :2], axis=1)[:, None]
    shifts = np.zeros_like(feet)
    shifts[:, :2] = outwards - outwards.mean(axis=0)
    return np.asarray(shifts.reshape(-1) / np.linalg.norm(shifts))


def disturbed(
    system: control.StateSpace, disturbance: Array, *, duration: float
) -> tuple[Array, Array]:
    """Returns times (steps,) [s] and outputs (outputs, steps) of a discrete system's response.

    disturbance: final values (inputs,) of ramps at the inputs; a jump would give the servos an
    impulse of commanded speed.
    """
    time = np.arange(round(duration / system.dt)) * system.dt
    ramps = np.outer(disturbance, np.clip((time + time[1]) / RISE, 0.0, 1.0))
    return time, np.asarray(control.forced_response(system, time, ramps, squeeze=False).outputs)


def _step(loops: PaperLoops, gains: Gains) -> Any:
    """Draws the forces on feet that are spread, and on a foot on a bump, with and without law."""
    figure, (row,) = _figure(1, 2, gains)
    robot, plant = loops.robot, _nominal(loops.robot, loops.plants)
    spread, share = _splay(robot, plant), weight_share(robot)
    bump = np.zeros(len(spread))
    bump[2] = -1.0
    for system, label, colour, dashes in (
        (shifted(robot, plant), "without the law", COLOURS["without"], "--"),
        (
            closed_loop(robot, plant, gains.paper, delays=loops.delays),
            "with the law",
            COLOURS["worst"],
            "-",
        ),
    ):
        for axes, shift in zip(row, (spread, bump), strict=True):
            time, forces = disturbed(system, SHIFT * shift, duration=STEP_TIME)
            axes.step(
                time, -shift @ forces / share, where="post", color=colour, ls=dashes, label=label
            )
    row[0].set(title=f"feet spread by {1e3 * SHIFT:g} mm", ylabel="squeeze [weight / 3]")
    row[1].set(title=f"a foot on a bump of {1e3 * SHIFT:g} mm", ylabel="excess load [weight / 3]")
    for axes in row:
        axes.axhline(0.0, color="k", lw=0.6)
        axes.set(xlabel="time [s]")
    _legend_below(figure, row[0])
    return figure


def _margins(loci: Response, loops: PaperLoops, gains: Gains) -> Any:
    """Draws the least gain margin over further delay."""
    figure, ((late,),) = _figure(1, 1, gains)
    delays = np.linspace(0.0, MOST_DELAY, DELAYS)
    sizes = [critical_size(loci * np.exp(-1j * loops.omega * delay)).max() for delay in delays]
    late.plot(1e3 * delays, -20.0 * np.log10(sizes), color=COLOURS["worst"], marker="o", ms=3)
    asked, colour = gains.requirements.gain_margin, COLOURS["asked"]
    late.axhline(asked, color=colour, ls="--", lw=1.0, label="asked without it")
    late.axhline(0.0, color="k", lw=0.6)
    late.set(xlabel="further delay [ms]", ylabel="gain margin [dB]")
    _legend_below(figure, late)
    return figure
