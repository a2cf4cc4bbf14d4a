"""Runs plant and controller FMUs with a co-simulation master of thirty lines on fmpy.

Variables of the same name are connected.

usage: python examples/04_two_fmus.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

from hexapod_cosim.cosim.export.plant import export_controller, export_fmu
from hexapod_cosim.cosim.run.plan import make_setup
from hexapod_cosim.models import load_robot

STEP, STEPS, SPEED = 0.005, 1000, 0.08  # s, 1, m/s


class Instance:
    """An FMU instance with access to its variables by name."""

    def __init__(self, path: Path) -> None:
        description, folder = read_model_description(path), extract(path, path.with_suffix(""))
        identifier = description.coSimulation.modelIdentifier
        self.fmu = FMU2Slave(
            guid=description.guid,
            modelIdentifier=identifier,
            unzipDirectory=folder,
            instanceName=path.stem,
        )
        self.reference = {
            variable.name: variable.valueReference for variable in description.modelVariables
        }
        self.inputs = {
            variable.name
            for variable in description.modelVariables
            if variable.causality == "input"
        }
        self.outputs = {
            variable.name
            for variable in description.modelVariables
            if variable.causality == "output"
        }

    def start(self) -> None:
        """Initialises the FMU up to step mode."""
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def get(self, names: list[str]) -> list[float]:
        """Returns the present values of variables."""
        return list(self.fmu.getReal([self.reference[name] for name in names]))

    def set(self, names: list[str], values: list[float]) -> None:
        """Sets the values of inputs."""
        self.fmu.setReal([self.reference[name] for name in names], values)


def walk(plant: Instance, controller: Instance) -> float:
    """Walks straight for five seconds; returns the distance of the torso [m]."""
    sensed = sorted(plant.outputs & controller.inputs)
    commanded = sorted(controller.outputs & plant.inputs)
    controller.set(["command.vx"], [SPEED])
    for k in range(STEPS):
        controller.set(sensed, plant.get(sensed))
        # the controller's outputs already depend on the inputs just set
        plant.set(commanded, controller.get(commanded))
        for instance in (plant, controller):
            instance.fmu.doStep(currentCommunicationPoint=k * STEP, communicationStepSize=STEP)
    return plant.get(["torso.position[1]"])[0]


def main() -> None:
    """Exports both, connects them and prints how far they walk."""
    robot = load_robot("athena")
    with TemporaryDirectory() as folder:
        plant = Instance(export_fmu(robot, Path(folder) / "plant.fmu"))
        controller = Instance(
            export_controller(
                make_setup(robot, control="paper", period=STEP), Path(folder) / "controller.fmu"
            )
        )
        for instance in (plant, controller):
            instance.start()
        measurements = plant.outputs & controller.inputs
        commands = controller.outputs & plant.inputs
        print(f"{len(measurements)} measurements, {len(commands)} commands")
        print(f"the torso walks {walk(plant, controller):.4f} m in {STEPS * STEP:g} s")
        for instance in (plant, controller):
            instance.fmu.freeInstance()


if __name__ == "__main__":
    main()
