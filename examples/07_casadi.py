"""Tunes a servo gain and a foot path with CasADi's Ipopt, by derivatives of the plant FMU.

The standing robot shall rise by RISE while it is pushed sideways. A chain of derivatives runs
beside the FMU's steps: exp(M h) of the matrix M of the directional derivatives of its rates takes
the change of the state by both numbers from step to step. Feet must not lift or touch down.
A simulation of a scenario checks the cost.

usage: pip install casadi; python examples/07_casadi.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from numpy.typing import NDArray
from scipy.linalg import expm

import hexapod_cosim
from hexapod_cosim.controller import BodyCommand, JointCommand, Measurement
from hexapod_cosim.controller.walk.kinematics import LegSolver
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.models import load_robot

Array = NDArray[np.float64]
STEP, STEPS, SETTLED = 0.005, 60, 100  # s, 1, 1
RISE, PUSH, SOFT = 0.01, 5.0, 1e-6  # m, N, m2/(N m)2
SCALE, START = np.array([40.0, 0.01]), np.array([40.0, 0.01])  # N m/rad, m  gain, height
LOW, HIGH = np.array([10.0, 0.002]), np.array([80.0, 0.02])


class Rise:
    """The FMU of a robot that stands, and the cost of its rise with its gradient."""

    def __init__(self, folder: Path) -> None:
        robot = load_robot("athena")
        path = export_fmu(robot, folder / "athena.fmu")
        description = read_model_description(path)
        self.reference = {one.name: one.valueReference for one in description.modelVariables}
        rates = [one.variable for one in description.derivatives]
        self.rates = [one.valueReference for one in rates]
        self.states = [one.derivative.valueReference for one in rates]
        names = [f"{leg.name}.{link}" for leg in robot.legs for link in ("coxa", "femur", "tibia")]
        self.given = [self.reference[f"{name}.angle_ref"] for name in names]
        self.gain = [self.reference["servo.kp"]]
        self.outputs = ["torso.position[3]", "torso.velocity[2]"]
        self.outputs += [f"{name}.torque" for name in names]
        self.shown = [self.reference[name] for name in self.outputs]
        self.knowns = self.states + self.gain + self.given
        self.weight = np.array([1.0, 1e-3, *[SOFT] * len(names)])
        self.legs, self.stance = LegSolver(robot), robot.stance
        self.fmu = FMU2Slave(
            guid=description.guid,
            modelIdentifier=description.coSimulation.modelIdentifier,
            unzipDirectory=extract(path, folder / "athena"),
            instanceName="plant",
        )
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        for k in range(SETTLED):
            self.fmu.doStep(k * STEP, STEP)
        self.settled = self.fmu.getFMUState()
        self.goal = np.zeros(len(self.shown))
        self.goal[0] = self.fmu.getReal(self.shown[:1])[0] + RISE

    def path(self, height: float, time: float) -> tuple[Array, Array]:
        """Returns the commanded angles (18,) [rad] and their derivative by the height [rad/m]."""
        shape = 0.5 - 0.5 * np.cos(np.pi * min(1.0, time / (0.5 * STEP * STEPS)))
        foot = self.legs.forward(self.stance) - [0.0, 0.0, height * shape]
        angle = self.legs.inverse(foot)
        down = np.linalg.solve(self.legs.jacobian(angle), np.full((6, 3, 1), [[0], [0], [-shape]]))
        return angle.ravel(), down.ravel()

    def matrix(self, down: Array) -> Array:
        """Returns the matrix of changes of states, gain and height, times the step."""
        n, seeds = len(self.states), np.zeros((len(self.states) + 2, len(self.knowns)))
        seeds[: n + 1, : n + 1] = np.eye(n + 1)
        seeds[n + 1, n + 1 :] = down
        rows = [
            self.fmu.getDirectionalDerivative(self.rates, self.knowns, list(seed)) for seed in seeds
        ]
        return STEP * np.vstack([np.array(rows).T, np.zeros((2, n + 2))])

    def cost(self, number: Array, *, gradient: bool = False) -> tuple[float, Array]:
        """Returns the cost [m2] of gain [N m/rad] and height [m], and its gradient or zeros."""
        n, cost, slope = len(self.states), 0.0, np.zeros(2)
        change = np.vstack([np.zeros((n, 2)), np.eye(2)])
        self.fmu.setFMUState(self.settled)
        self.fmu.setReal(self.gain, [number[0]])
        self.fmu.setReal([self.reference["torso.push_force[2]"]], [PUSH])
        for k in range(STEPS):
            angle, down = self.path(number[1], (k + 1) * STEP)
            self.fmu.setReal(self.given, list(angle))
            before = self.matrix(down) if gradient else None
            self.fmu.doStep((SETTLED + k) * STEP, STEP)
            shown = np.array(self.fmu.getReal(self.shown)) - self.goal
            cost += float(self.weight @ shown**2)
            if before is None:
                continue
            change = expm(0.5 * (before + self.matrix(down))) @ change
            for j, seed in enumerate(change.T):
                seeds = [*seed[: n + 1], *(seed[n + 1] * down)]
                found = self.fmu.getDirectionalDerivative(self.shown, self.knowns, seeds)
                slope[j] += 2.0 * (self.weight * shown) @ np.array(found)
        return cost, slope


class Riser:
    """A controller that stands for SETTLED steps and then rises."""

    def __init__(self, rise: Rise, height: float) -> None:
        self.rise, self.height = rise, height  # m

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """Returns the joint commands for the next macro-step."""
        del command, measurement
        angle, _ = self.rise.path(self.height, max(0.0, t - (SETTLED - 1) * STEP))
        return JointCommand(angle_ref=angle.reshape(6, 3), speed_ref=np.zeros((6, 3)))


def simulated_cost(rise: Rise, number: Array) -> float:
    """Returns the cost [m2] of gain [N m/rad] and height [m] by a simulation of a scenario."""
    begin, length = SETTLED * STEP, STEPS * STEP
    events = [
        {"time": begin, "duration": length, "force": [0.0, PUSH, 0.0]},
        {"time": begin, "parameter": "servo.kp", "value": float(number[0])},
    ]
    settings = {"duration": begin + length, "macro_step": STEP, "events": events}
    result = hexapod_cosim.simulate("stand", Riser(rise, number[1]), settings=settings)
    shown = result.recording.columns(rise.outputs)[-STEPS:] - rise.goal
    return float(np.sum(shown**2 @ rise.weight))


def tune(rise: Rise) -> Array:
    """Returns gain and height of least cost, by Ipopt."""
    import casadi  # noqa: PLC0415

    class Gradient(casadi.Callback):  # type: ignore[misc]
        def __init__(self) -> None:
            casadi.Callback.__init__(self)
            self.construct("gradient", {})

        def get_n_in(self) -> int:
            """The numbers, and the cost there."""
            return 2

        def get_sparsity_in(self, i: int) -> object:
            return casadi.Sparsity.dense(2 - i, 1)

        def get_sparsity_out(self, _: int) -> object:
            return casadi.Sparsity.dense(1, 2)

        def eval(self, arg: list[object]) -> list[object]:
            scaled = np.array(arg[0]).ravel()
            slope = rise.cost(scaled * SCALE, gradient=True)[1]
            return [casadi.DM(1e4 * slope * SCALE).T]

    class Cost(casadi.Callback):  # type: ignore[misc]
        def __init__(self) -> None:
            casadi.Callback.__init__(self)
            self.gradient = Gradient()
            self.construct("cost", {})

        def get_sparsity_in(self, _: int) -> object:
            return casadi.Sparsity.dense(2, 1)

        def eval(self, arg: list[object]) -> list[object]:
            return [1e4 * rise.cost(np.array(arg[0]).ravel() * SCALE)[0]]

        def has_jacobian(self) -> bool:
            return True

        def get_jacobian(self, *_: object) -> object:
            return self.gradient

    x, cost = casadi.MX.sym("x", 2), Cost()
    options = {"hessian_approximation": "limited-memory", "max_iter": 15, "tol": 1e-4}
    solver = casadi.nlpsol(
        "tune", "ipopt", {"x": x, "f": cost(x)}, {"ipopt": {**options, "print_level": 0}}
    )
    found = solver(x0=START / SCALE, lbx=LOW / SCALE, ubx=HIGH / SCALE)
    return np.array(found["x"]).ravel() * SCALE


def main() -> None:
    """Compares the gradient with differences, tunes, and shows both costs."""
    with TemporaryDirectory() as folder:
        rise = Rise(Path(folder))
        before, slope = rise.cost(START, gradient=True)
        ends = [
            [rise.cost(START + sign * 1e-3 * step)[0] for sign in (1, -1)]
            for step in np.diag(SCALE)
        ]
        differences = [(high - low) / 2e-3 for high, low in ends]
        print("gradient   ", *(f"{v:.4e}" for v in slope * SCALE))
        print("differences", *(f"{v:.4e}" for v in differences))
        print(f"cost {before:.4g}, simulated {simulated_cost(rise, START):.4g}")
        try:
            best = tune(rise)
        except ImportError:
            print("without casadi nothing is tuned: pip install casadi")
        else:
            after = rise.cost(best)[0]
            print(f"servo.kp {best[0]:.1f} N m/rad, height {1e3 * best[1]:.2f} mm")
            print(f"cost {before:.4g} -> {after:.4g}, simulated {simulated_cost(rise, best):.4g}")
        rise.fmu.freeFMUState(rise.settled)
        rise.fmu.terminate()
        rise.fmu.freeInstance()


if __name__ == "__main__":
    main()
