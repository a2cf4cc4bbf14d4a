"""Simulates the plant FMU without inputs: the robot stands still.

usage: python examples/01_stand.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import fmpy

from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.models import load_robot


def main() -> None:
    """Exports the FMU, simulates it with fmpy, and prints the force on each foot."""
    robot = load_robot("athena")
    feet = [f"{leg.name}.foot.normal_force" for leg in robot.legs]
    with TemporaryDirectory() as folder:
        fmu = export_fmu(robot, Path(folder) / "athena.fmu")
        result = fmpy.simulate_fmu(fmu, stop_time=1.0, output=["torso.position[3]", *feet])
    sag = result["torso.position[3]"][-1] - result["torso.position[3]"][0]
    print(f"height changes by {1e6 * sag:.3f} um in 1 s")
    for foot in feet:
        print(f"{foot}: {result[foot][-1]:.3f} N")
    carried = sum(result[foot][-1] for foot in feet)
    print(f"sum {carried:.3f} N, weight {robot.total_mass * 9.81:.3f} N")


if __name__ == "__main__":
    main()
