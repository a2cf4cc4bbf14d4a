"""Tunes the plant as a block of Simulink: parameters are set by name while a simulation pauses.

`Block` has the calls of a MATLAB script: `sim` up to a time and pause, `set_param`, `get_param`.
The same changes as events of a scenario give the same motion.

usage: python examples/08_block_parameters.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

from fmpy import extract, read_model_description
from fmpy.simulation import instantiate_fmu

import hexapod_cosim
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.models import load_robot

STEP, END = 0.005, 1.5  # s
TUNED = (  # s, name, SI
    (0.5, "servo.kp", 15.0),
    (1.0, "torso.mass", 4.0),
    (1.0, "friction.mu", 0.3),
)
SHOWN = "torso.position[3]"


class Block:
    """The plant as a block whose tunable parameters are those of its mask."""

    def __init__(self, path: Path) -> None:
        description = read_model_description(path)
        self.variable = {one.name: one for one in description.modelVariables}
        unpacked = extract(path, path.with_suffix(""))
        self.fmu = instantiate_fmu(unpacked, description, "CoSimulation")
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.steps = 0

    def mask(self) -> list[str]:
        """Returns the names of the tunable parameters."""
        return [name for name, one in self.variable.items() if one.variability == "tunable"]

    def set_param(self, name: str, value: float) -> None:
        """Sets a tunable parameter, which the next step uses."""
        self.fmu.setReal([self.variable[name].valueReference], [value])

    def get_param(self, name: str) -> float:
        """Returns the present value of a variable."""
        return float(self.fmu.getReal([self.variable[name].valueReference])[0])

    def sim(self, until: float) -> None:
        """Simulates up to a time [s] and pauses."""
        while self.steps < round(until / STEP):
            self.fmu.doStep(self.steps * STEP, STEP)
            self.steps += 1


def simulated_height() -> float:
    """Returns the height [m] at the end of a scenario with the same changes as events."""
    events = [{"time": t, "parameter": name, "value": value} for t, name, value in TUNED]
    settings = {"duration": END, "macro_step": STEP, "events": events}
    result = hexapod_cosim.simulate("stand", "kinematic", settings=settings)
    return float(result.recording.columns([SHOWN])[-1, 0])


def main() -> None:
    """Changes a gain, a mass and the friction, tries a fixed parameter, and shows the height."""
    with TemporaryDirectory() as folder:
        block = Block(export_fmu(load_robot("athena"), Path(folder) / "athena.fmu"))
        print(f"{len(block.mask())} tunable parameters, foot.radius is none of them")
        for time, name, value in TUNED:
            block.sim(time)
            print(f"{time:g} s, {1e3 * block.get_param(SHOWN):.2f} mm high: {name} = {value:g}")
            block.set_param(name, value)
        block.sim(END)
        print(f"{END:g} s, {1e3 * block.get_param(SHOWN):.2f} mm high")
        print(f"scenario with the same events: {1e3 * simulated_height():.2f} mm high")
        print(f"energy audit: {block.get_param('energy.residual'):.1e} J")
        block.fmu.terminate()
        block.fmu.freeInstance()


if __name__ == "__main__":
    main()
