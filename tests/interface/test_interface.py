"""Tests that interface.toml contains the agreed names and that the generated files
agree with it.
"""

from __future__ import annotations

import dataclasses
import re
import subprocess
import sys
from pathlib import Path

import fmpy
import pytest
from fmi_plant import ATHENA, GUID

from hexapod_cosim.cosim.interface.model_description import render_fmi2
from hexapod_cosim.cosim.interface.patterns import with_defaults
from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.models.errors import HexapodError
from hexapod_cosim.models.robot import load_robot

ROOT = Path(__file__).resolve().parents[2]
LEGS = ("LF", "LM", "LR", "RF", "RM", "RR")
JOINTS = ("coxa", "femur", "tibia")
INERTIA = ("xx", "yy", "zz", "xy", "xz", "yz")

# names that other tools rely on; L, J, i and I stand for legs, joints, indices and entries of
# inertias
CONTRACT = {
    "input": (
        "L.J.angle_ref L.J.speed_ref L.J.torque_ref torso.push_force[3] torso.push_torque[3] "
        "L.J.acceleration_ref"
    ),
    "output": "L.J.angle L.J.speed L.J.torque L.J.reaction_force[3] L.J.reaction_torque[3] "
    "L.foot.force[3] L.foot.normal_force L.foot.tangential_force L.foot.position[3] "
    "L.foot.velocity[3] L.foot.slip_speed "
    "L.foot.bristle[3] L.foot.penetration L.foot.contact L.foot.impact_speed "
    "torso.position[3] torso.quaternion[4] torso.roll torso.pitch torso.yaw "
    "torso.velocity[3] torso.angular_velocity[3] imu.specific_force[3] imu.angular_velocity[3] "
    "energy.kinetic energy.potential energy.actuator_work energy.dissipated energy.residual "
    "energy.push_work "
    "constraint.position_error constraint.velocity_error solver.evaluations solver.steps "
    "solver.rejected solver.touchdowns "
    "L.J.positive_work L.J.negative_work L.J.torque_squared L.foot.slip_distance "
    "L.foot.impulse L.foot.peak_force "
    "L.foot.peak_force_rate L.foot.landing_rate L.foot.landings energy.contact_loss "
    "energy.friction_loss energy.gear_loss feet.cone_time[31]",
    "parameter": "torso.mass torso.com[3] torso.inertia_I "
    "L.J.mass L.J.length L.J.offset_y L.J.offset_z L.J.com[3] L.J.inertia_I L.J.axis[3] "
    "L.hip_position[3] L.hip_yaw foot.radius contact.law contact.stiffness "
    "contact.restitution contact.damping_factor "
    "contact.impact_speed_floor friction.law friction.mu friction.slope friction.presliding "
    "friction.bristle_damping "
    "servo.mode servo.kp servo.kd servo.torque_max servo.speed_max servo.rotor_inertia "
    "servo.coulomb_friction "
    "baumgarte.alpha baumgarte.beta gravity[3] solver.method solver.step solver.tolerance "
    "solver.step_max terrain.kind terrain.height terrain.incline terrain.heading "
    "initial.position[3] initial.quaternion[4] "
    "initial.velocity[3] initial.angular_velocity[3] initial.L.J.angle initial.L.J.speed "
    "friction.mu_static friction.stribeck_speed",
}


def expand(pattern: str) -> list[str]:
    parts = pattern.split(".")
    names = [""]
    for part in parts:
        stem, _, size = part.removesuffix("]").partition("[")
        labels = {"L": LEGS, "J": JOINTS}.get(stem, (stem,))
        if stem.endswith("_I"):
            labels = tuple(stem[:-1] + entry for entry in INERTIA)
        indices = [f"[{i}]" for i in range(1, int(size) + 1)] if size else [""]
        names = [
            f"{name}.{label}{index}" for name in names for label in labels for index in indices
        ]
    return [name[1:] for name in names]


@pytest.mark.parametrize("causality", CONTRACT)
def test_every_name_of_the_contract_exists_with_its_causality(causality: str) -> None:
    expected = {name for pattern in CONTRACT[causality].split() for name in expand(pattern)}
    actual = {variable.name for variable in ATHENA.variables if variable.causality == causality}
    assert expected - actual == set()


def test_no_two_variables_share_a_field_and_each_is_named_after_its_own() -> None:
    assert len({variable.field for variable in ATHENA.variables}) == len(ATHENA.variables)
    for variable in ATHENA.variables:
        identifiers = set(re.findall(r"[a-z_]+", variable.field)) - {
            "definition",
            "input",
            "output",
            "rate",
            "leg",
            "link",
            "body",
        }
        assert [
            word for word in identifiers if word not in variable.name.replace(".", "_")
        ] == [], variable.name


def test_every_variable_has_a_description_and_every_real_a_unit_and_a_nonzero_nominal() -> None:
    for variable in ATHENA.variables:
        assert variable.description, variable.name
        if variable.type == "Real":
            assert variable.unit, variable.name
            assert variable.nominal, variable.name


MEMBER = re.compile(
    r"(?P<opened>struct \{)|\} (?P<closed>\w+);|"
    r"(?:double|hxIndicators) (?P<names>[^;]+);(?: +/\* +(?P<unit>.*?)(?:  | \*/|$))?",
    re.MULTILINE,
)


def units_in_header() -> dict[str, list[str]]:
    """Returns the units in the comments on hxOutput, "m or 1" as two, by the fields' names."""
    header = (ROOT / "plant_fmu/include/hexapod/hexapod.h").read_text(encoding="utf-8")
    text = header.partition("typedef struct hxOutput {")[2].partition("} hxOutput;")[0]
    found: dict[str, list[str]] = {}
    inner: list[str] = []
    for member in MEMBER.finditer(text):
        if member["closed"]:
            found |= {f"{member['closed']}.{name}": found.pop(name) for name in inner}
        if not member["names"]:
            inner = []
            continue
        names = re.sub(r"\[[^]]*\]", "", member["names"]).split(", ")
        units = (member["unit"] or "").replace(" m", ".m").replace(" s", ".s").split(", ")
        units = units if len(units) == len(names) else units * len(names)
        found |= {name: unit.split(" or ") for name, unit in zip(names, units, strict=True)}
        inner += names
    return found


def test_the_comments_on_outputs_in_c_give_the_units_of_the_interface() -> None:
    units = units_in_header()
    reals = [one for one in ATHENA.variables if one.type == "Real"]
    named = {one.field.removeprefix("output."): one.unit for one in reals if "output." in one.field}
    assert len(named) > 500
    for field, unit in named.items():
        assert unit in units[re.sub(r"\[\w+\]", "", field)], field


def test_start_values_are_those_of_the_robot() -> None:
    robot = load_robot("athena")
    assert ATHENA.variable("torso.mass").start == robot.torso.mass
    assert ATHENA.variable("RM.femur.com[2]").start == robot.legs[4].links[1].com[1]
    assert ATHENA.variable("LR.tibia.inertia_zz").start == robot.legs[2].links[2].inertia[2]
    assert ATHENA.variable("LM.tibia.angle_ref").start == robot.legs[1].stance[2]
    assert ATHENA.variable("contact.law").start == 1


def test_an_unknown_name_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(HexapodError, match=r"LF\.coxa\.angle_ref"):
        ATHENA.references(["LF.coxa.angel_ref"])


def test_an_unknown_unit_is_refused_by_the_variable_s_name() -> None:
    entry = {"name": "torso.shade", "unit": "lux"}
    with pytest.raises(HexapodError, match=r"interface.toml: torso.shade: unknown unit: got 'lux'"):
        with_defaults(entry, "output", {"m": {}})


def test_a_robot_that_does_not_fit_its_variables_is_refused() -> None:
    robot = load_robot("athena")
    impossible = dataclasses.replace(
        robot, contact=dataclasses.replace(robot.contact, restitution=1.5)
    )
    with pytest.raises(HexapodError, match=r"contact\.restitution.*1\.5"):
        load_interface(impossible)


def test_the_guid_depends_on_every_number_of_the_robot() -> None:
    robot = load_robot("athena")
    heavier = dataclasses.replace(
        robot, torso=dataclasses.replace(robot.torso, mass=robot.torso.mass * (1 + 1e-15))
    )
    assert render_fmi2(load_interface(heavier)).guid != GUID
    assert render_fmi2(load_interface(load_robot("phantomx_mk4"))).guid != GUID
    assert render_fmi2(load_interface(load_robot("athena"))).guid == GUID


def test_generated_files_are_what_the_generator_makes() -> None:
    command = [sys.executable, str(ROOT / "tools" / "generate.py"), "--check"]
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stdout + process.stderr


def test_the_model_description_agrees_with_the_interface(athena_fmu: Path) -> None:
    description = fmpy.read_model_description(str(athena_fmu))
    assert description.guid == GUID
    for variable, described in zip(ATHENA.variables, description.modelVariables, strict=True):
        assert (described.name, described.valueReference, described.type) == (
            variable.name,
            variable.reference,
            variable.type,
        )
        assert (described.causality, described.variability, described.unit) == (
            variable.causality,
            variable.variability,
            variable.unit,
        )
        for text, number in (
            (described.start, variable.start),
            (described.min, variable.minimum),
            (described.max, variable.maximum),
        ):
            assert (None if text is None else float(text)) == number, variable.name
