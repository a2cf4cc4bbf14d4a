"""Tunes a servo gain of a standing robot while the FMU runs, by trials that are rolled back.

From one saved state, trials of half a second under a sideways push differ in servo.kp alone. Golden
section finds the gain of least sway and torque.

usage: python examples/06_tunable.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

from fmpy import extract, read_model_description
from fmpy.simulation import instantiate_fmu

from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.models import load_robot

STEP, SETTLED, TRIAL = 0.005, 100, 100  # s, 1, 1
LOW, HIGH, PUSH = 5.0, 80.0, 10.0  # N m/rad, N m/rad, N
GOLDEN = 0.6180339887498949


class Bench:
    """A standing robot, its state after it has settled, and trials from there."""

    def __init__(self, path: Path) -> None:
        description = read_model_description(path)
        self.reference = {one.name: one.valueReference for one in description.modelVariables}
        unpacked = extract(path, path.with_suffix(""))
        self.fmu = instantiate_fmu(unpacked, description, "CoSimulation")
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.steps = 0
        self.run(SETTLED)
        self.settled = self.fmu.getFMUState(), self.steps

    def set(self, name: str, value: float) -> None:
        """Sets an input, or a tunable parameter between two steps."""
        self.fmu.setReal([self.reference[name]], [value])

    def get(self, name: str) -> float:
        """Returns the present value of a variable."""
        return float(self.fmu.getReal([self.reference[name]])[0])

    def run(self, steps: int) -> float:
        """Steps the robot; returns the integral of squared sway and squared torque [m2 s]."""
        cost = 0.0
        for _ in range(steps):
            self.fmu.doStep(self.steps * STEP, STEP)
            self.steps += 1
            sway, torque = self.get("torso.velocity[2]"), self.get("LM.femur.torque")
            cost += STEP * (sway**2 + 1e-5 * torque**2)
        return cost

    def trial(self, gain: float) -> float:
        """Returns the cost of a push with a gain, and rolls back."""
        state, self.steps = self.settled
        self.fmu.setFMUState(state)
        self.set("servo.kp", gain)
        self.set("torso.push_force[2]", PUSH)
        return self.run(TRIAL)


def least(bench: Bench, low: float, high: float) -> float:
    """Returns the gain of least cost, by golden section."""
    a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    cost_a, cost_b = bench.trial(a), bench.trial(b)
    while high - low > 1.0:
        if cost_a < cost_b:
            high, b, cost_b = b, a, cost_a
            a = high - GOLDEN * (high - low)
            cost_a = bench.trial(a)
        else:
            low, a, cost_a = a, b, cost_b
            b = low + GOLDEN * (high - low)
            cost_b = bench.trial(b)
    return 0.5 * (low + high)


def main() -> None:
    """Tunes the gain and shows the cost before and after."""
    with TemporaryDirectory() as folder:
        bench = Bench(export_fmu(load_robot("athena"), Path(folder) / "athena.fmu"))
        own = bench.get("servo.kp")
        before, gain = bench.trial(own), least(bench, LOW, HIGH)
        after = bench.trial(gain)
        print(f"servo.kp {own:g} -> {gain:.1f} N m/rad, cost {before:.3g} -> {after:.3g}")
        print(f"energy audit: {bench.get('energy.residual'):.1e} J")
        bench.fmu.freeFMUState(bench.settled[0])
        bench.fmu.terminate()
        bench.fmu.freeInstance()


if __name__ == "__main__":
    main()
