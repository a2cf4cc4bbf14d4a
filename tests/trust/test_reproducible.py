"""Tests that equal sources give equal bytes."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

EXPORT = """
import sys
from pathlib import Path
from hexapod_cosim.controller import make_gait
from hexapod_cosim.cosim.export.plant import export_controller
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.models import load_robot
robot, folder = load_robot("athena"), Path(sys.argv[1])
setup = ControllerSetup(robot=robot, gait=make_gait(robot), period=0.005)
for fmi in (2, 3):
    export_fmu(robot, folder / f"plant{fmi}.fmu", fmi=fmi)
    export_controller(setup, folder / f"controller{fmi}.fmu", fmi=fmi)
"""


def test_two_exports_in_other_processes_zones_and_folders_are_the_same_bytes(
    plant_build: Path, tmp_path: Path
) -> None:
    digests = []
    for number, (seed, place) in enumerate((("1", "UTC"), ("2", "Asia/Tokyo"))):
        folder = tmp_path / f"a folder {number}"
        folder.mkdir()
        environment = os.environ | {"PYTHONHASHSEED": seed, "TZ": place}
        subprocess.run([sys.executable, "-c", EXPORT, str(folder)], env=environment, check=True)
        digests.append(
            {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.iterdir()}
        )
    assert len(digests[0]) == 4
    assert digests[0] == digests[1]
