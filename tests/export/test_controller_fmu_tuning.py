"""Gait and control of the controller FMU are tunable while the robot walks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from controller_fmus import ANGLE, packed, walk
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave
from gains import PERIOD, make_gains

from hexapod_cosim.controller import BodyCommand, Measurement, make_gait
from hexapod_cosim.cosim.control.fmu_law import law_of_ours
from hexapod_cosim.cosim.export.plant import export_controller
from hexapod_cosim.cosim.interface.controller import (
    ControllerSetup,
    controller_parameters,
)
from hexapod_cosim.cosim.master.fmu import StepError
from hexapod_cosim.models import FmuError, load_robot


def gait_parameters(setup: ControllerSetup) -> dict[str, float]:
    found = controller_parameters(setup)
    return {name: value for name, value in found.items() if name.startswith("gait.")}


def test_the_gait_is_tunable_while_the_robot_walks(tmp_path: Path) -> None:
    """The FMU changes its gait as the Python controller does; other parameters stay fixed."""
    robot, measurement = load_robot("athena"), Measurement(angle=load_robot("athena").stance.copy())
    setup = ControllerSetup(robot=robot, gait=make_gait(robot), period=PERIOD)
    amble = replace(setup, gait=make_gait(robot, "amble"))
    command, lead = BodyCommand(vx=0.03), setup.build()
    with packed(setup, tmp_path) as fmu:
        walker, worst = law_of_ours(fmu, period=PERIOD), 0.0
        for k in range(800):
            if k == 330:
                fmu.set_parameters(gait_parameters(amble))
                lead.change_gait(amble.gait)
                with pytest.raises(FmuError, match=r"gains.hold.path_rate: got a value after init"):
                    fmu.set_parameters({"gains.hold.path_rate": 1.0})
            ours = lead.step(k * PERIOD, command, measurement)
            theirs = walker.step(k * PERIOD, command, measurement)
            worst = max(worst, float(np.abs(ours.angle_ref - theirs.angle_ref).max()))
        assert lead.gait is amble.gait
        assert worst < ANGLE
        tunable = [
            name for name, variable in fmu.variables.items() if variable.variability == "tunable"
        ]
        assert tunable == ["control", *gait_parameters(amble)]


def test_the_control_is_tunable_while_the_robot_walks(tmp_path: Path) -> None:
    """The FMU changes its control as the Python controller does, also together with the gait."""
    robot, measurement = load_robot("athena"), Measurement(angle=load_robot("athena").stance.copy())
    gains = make_gains(robot)
    setup = ControllerSetup(robot=robot, gait=make_gait(robot), period=PERIOD, gains=gains)
    amble = replace(setup, gait=make_gait(robot, "amble"))
    command, lead = BodyCommand(vx=0.03), setup.build()
    with packed(setup, tmp_path) as fmu:
        walker, worst = law_of_ours(fmu, period=PERIOD), 0.0
        for k in range(800):
            if k == 330:
                fmu.set_parameters({"control": 3.0})
                lead.change_control(gains, "paper")
            if k == 500:
                fmu.set_parameters({**gait_parameters(amble), "control": 1.0})
                lead.change_control(None)
                lead.change_gait(amble.gait)
            ours = lead.step(k * PERIOD, command, measurement)
            theirs = walker.step(k * PERIOD, command, measurement)
            worst = max(worst, float(np.abs(ours.angle_ref - theirs.angle_ref).max()))
        assert (lead.gait, lead.gains) == (amble.gait, None)
    assert worst < ANGLE


def test_a_gait_that_is_too_fast_is_refused_and_the_next_one_is_taken(tmp_path: Path) -> None:
    robot = load_robot("athena")
    setup = ControllerSetup(robot=robot, gait=make_gait(robot), period=PERIOD)
    with packed(setup, tmp_path) as fmu:
        expected = walk(fmu, 0, 300)
    with packed(setup, tmp_path) as fmu:
        first = walk(fmu, 0, 100)
        fmu.set_parameters({"gait.period": 0.008})
        with pytest.raises(StepError, match="gait's shorter phase; the state is unchanged"):
            fmu.step(100 * PERIOD, PERIOD)
        fmu.set_parameters({"gait.period": setup.gait.period})
        np.testing.assert_array_equal(np.vstack([first, walk(fmu, 100, 200)]), expected)


def test_the_gait_is_tunable_in_fmi_3_too(plant_build: Path, tmp_path: Path) -> None:
    robot = load_robot("athena")
    setup = ControllerSetup(robot=robot, gait=make_gait(robot), period=PERIOD)
    path = export_controller(setup, tmp_path / "controller.fmu", fmi=3)
    description = read_model_description(path)
    references = {one.name: one.valueReference for one in description.modelVariables}
    fmu = FMU3Slave(
        guid=description.guid,
        unzipDirectory=extract(path, str(tmp_path / "unpacked")),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="controller",
    )
    fmu.instantiate()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.doStep(0.0, PERIOD)
    fmu.setFloat64([references["gait.step_height"]], [0.02])
    with pytest.raises(FMICallException):
        fmu.setFloat64([references["period"]], [0.01])
    fmu.doStep(PERIOD, PERIOD)
    assert fmu.getFloat64([references["gait.step_height"]]) == [0.02]
    fmu.terminate()
    fmu.freeInstance()
