"""Tests misuse of the plant: its messages, and that the plant does not change."""

from __future__ import annotations

import ctypes as ct
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mirror import BAD_STATE, INVALID_ARGUMENT, INVALID_MODEL, MESSAGE_SIZE
from plant import Plant, PlantError, bound, definition, put
from states import MACRO, changed, landing, trail

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.servos.motor import FULL


def refused(plant: Plant, call: Callable[[], Any], status: int, pattern: str) -> None:
    """Asserts that a call fails with this status and message and leaves the plant unchanged."""
    before = plant.save()
    with pytest.raises(PlantError, match=pattern) as caught:
        call()
    assert caught.value.status == status
    assert plant.save() == before
    plant.step(plant.time + 1e-4)


def midway(core: ct.CDLL) -> Plant:
    robot = load_robot("athena")
    plant = Plant(core, robot, **landing(robot))
    trail(plant, 5)
    return plant


@pytest.mark.parametrize("share", [0.0, 0.005, 0.01, 0.2, 0.5, 0.9, 0.9999])
def test_a_damaged_state_is_refused(core: ct.CDLL, share: float) -> None:
    plant = midway(core)
    bad = bytearray(plant.save())
    bad[int(share * len(bad))] ^= 0x10
    refused(plant, lambda: plant.restore(bytes(bad)), BAD_STATE, "saved state: .*; save it again")


@pytest.mark.parametrize("size", [0, 8, -1, +8])
def test_a_state_of_another_size_is_refused(core: ct.CDLL, size: int) -> None:
    plant = midway(core)
    saved = plant.save() + bytes(16)
    cut = size if size in (0, 8) and size != +8 else len(saved) - 16 + size
    refused(
        plant, lambda: plant.restore(saved[:cut]), BAD_STATE, "saved state: got .* bytes, expected"
    )


BAD_NUMBERS = (math.nan, math.inf, -math.inf)


@pytest.mark.parametrize("number", BAD_NUMBERS)
@pytest.mark.parametrize(
    "name",
    ["angle_ref", "speed_ref", "torque_ref", "push_force", "push_torque", "acceleration_ref"],
)
@pytest.mark.parametrize("last", [False, True])
def test_an_input_that_is_no_number_is_refused(
    core: ct.CDLL, name: str, number: float, last: bool
) -> None:
    plant = midway(core)
    values = {"angle_ref": plant.robot.stance} | {name: np.array(getattr(plant.hold(), name))}
    values[name].ravel()[-1 if last else 0] = number
    pattern = rf"{name}(\[\d\])?: got -?(nan|inf), expected \S+ to \S+ (rad|rad/s2?|N\.m|N)$"
    refused(
        plant, lambda: plant.step(plant.time + MACRO, Command(**values)), INVALID_ARGUMENT, pattern
    )


def test_a_weakness_above_1_is_refused(core: ct.CDLL) -> None:
    plant = midway(core)
    weak = Command(angle_ref=plant.robot.stance, power=replace(FULL, strength=-0.5))
    pattern = r"weakness: got 1\.5, expected 0 to 1$"
    refused(plant, lambda: plant.step(plant.time + MACRO, weak), INVALID_ARGUMENT, pattern)


@pytest.mark.parametrize("end", [0.0, -1.0, 0.0199, *BAD_NUMBERS])
def test_an_end_that_is_past_or_no_number_is_refused(core: ct.CDLL, end: float) -> None:
    plant = midway(core)
    refused(
        plant,
        lambda: plant.step(end),
        INVALID_ARGUMENT,
        r"end of step: got \S+ s, expected a finite time of at least 0\.02\d* s",
    )


@pytest.mark.parametrize("number", BAD_NUMBERS)
def test_bodies_or_a_start_time_that_are_no_numbers_are_refused(
    core: ct.CDLL, number: float
) -> None:
    plant = midway(core)
    body = plant.bodies
    body[7, 4] = number
    refused(
        plant,
        lambda: setattr(plant, "bodies", body),
        INVALID_ARGUMENT,
        "body state: got a number that is not finite",
    )
    body = plant.bodies
    body[7, 3:7] = 0.0
    refused(
        plant,
        lambda: setattr(plant, "bodies", body),
        INVALID_ARGUMENT,
        "body state: got a quaternion of zeros",
    )
    start = definition(plant.robot)
    refused(
        plant, lambda: plant.reset(start, number), INVALID_ARGUMENT, "start time: got .* not finite"
    )


def field(d: Any, path: str) -> tuple[Any, str]:
    *above, last = path.split(".")
    for name in above:
        part, _, index = name.partition("[")
        d = getattr(d, part)
        d = d[int(index[:-1])] if index else d
    return d, last


IMPOSSIBLE: list[tuple[str, Any, str]] = [
    ("torso.mass", 0.0, r"torso\.mass: got 0, expected 1e-09 to 1e\+09 kg$"),
    ("torso.mass", math.nan, r"torso\.mass: got -?nan"),
    ("torso.com", (0.0, math.inf, 0.0), r"torso\.com\[2\]: got inf, expected -100 to 100 m$"),
    (
        "torso.inertia",
        (1.0, 1.0, 2.1, 0.0, 0.0, 0.0),
        r"torso\.inertia_zz: got 2\.1, expected an inertia that a body can have",
    ),
    ("torso.inertia", (1.0, 1.0, 1.0, 0.9, 0.9, -0.9), r"torso\.inertia_xx: .* a body can have"),
    ("leg[4].hip_position", (math.nan, 0.0, 0.0), r"RM\.hip_position\[1\]: got -?nan"),
    ("leg[2].link[1].mass", -0.1, r"LR\.femur\.mass: got -0\.1, expected 1e-09 to"),
    ("leg[0].link[0].length", 0.0, r"LF\.coxa\.length: got 0, expected a tip away from the joint"),
    ("leg[3].link[2].axis", (0.0, 0.0, 0.0), r"RF\.tibia\.axis: got 0, expected a direction"),
    (
        "leg[3].link[1].inertia",
        (1e-4, 1e-4, 3e-4, 0.0, 0.0, 0.0),
        r"RF\.femur\.inertia_zz: got 0\.0003",
    ),
    ("contact.law", 7, r"contact\.law: got 7, expected 1 to 6$"),
    ("contact.restitution", 1.1, r"contact\.restitution: got 1\.1, expected 0 to 1"),
    ("friction.law", 5, r"friction\.law: got 5, expected 1 to 4"),
    (
        "friction.mu_static",
        0.1,
        r"friction\.mu_static: got 0\.1, expected at least friction\.mu, or 0",
    ),
    (
        "leg[0].link[2].angle_min",
        3.0,
        r"LF\.tibia\.angle_min: got 3, expected an angle below the joint's angle_max",
    ),
    ("gravity", (0.0, 0.0, math.nan), r"gravity\[3\]: got -?nan"),
    (
        "initial.quaternion",
        (0.0, 0.0, 0.0, 0.0),
        r"initial\.quaternion: got 0, expected a quaternion",
    ),
]


def test_a_foot_deeper_than_its_radius_at_the_start_is_refused_with_its_name(core: ct.CDLL) -> None:
    """The stance's feet have their centres 0.12 m below the torso's, and a radius of 15 mm."""
    plant = midway(core)
    stance = plant.robot.stance.copy()
    height = 0.12
    start = definition(plant.robot, position=(0.0, 0.0, height + 0.0049), angle=stance)
    start.terrain.height = 0.025
    message = (
        r"initial\.position: got foot .. 0\.0351 m deep in the ground, expected at most 0\.015 m; "
        r"raise initial\.position\[3\] by 0\.0201 m or more, or lower "
        r"terrain\.height$"
    )
    refused(plant, lambda: plant.reset(start), INVALID_MODEL, message)


@pytest.mark.parametrize(
    ("path", "value", "pattern"),
    IMPOSSIBLE,
    ids=[f"{path}={value}" for path, value, _ in IMPOSSIBLE],
)
def test_a_definition_no_robot_can_have_is_refused(
    core: ct.CDLL, path: str, value: Any, pattern: str
) -> None:
    plant = midway(core)
    bad = definition(plant.robot)
    owner, name = field(bad, path)
    if isinstance(value, tuple):
        put(getattr(owner, name), value)
    else:
        setattr(owner, name, value)
    refused(plant, lambda: plant.reset(bad), INVALID_MODEL, "^" + pattern)
    message = ct.create_string_buffer(MESSAGE_SIZE)
    assert bound(core).hx_definition_check(bad, message) == INVALID_MODEL
    assert core.hx_definition_check(bad, None) == INVALID_MODEL
    assert message.value


def test_every_status_has_a_name(core: ct.CDLL) -> None:
    names = [bound(core).hx_status_name(status) for status in range(7)]
    assert len(set(names)) == 7
    assert core.hx_status_name(7) == core.hx_status_name(-1) == b"unknown status"


@pytest.mark.parametrize("settings", [{}, {"step": 1e-7}])
def test_no_call_runs_on_for_ever(core: ct.CDLL, settings: dict[str, float]) -> None:
    """A call with error control under an extreme push, and a call with a far too small step, fail
    within a bounded number of evaluations.
    """
    plant = Plant(core, changed(load_robot("athena"), solver=settings))
    before = plant.save()
    with pytest.raises(
        PlantError,
        match=r"finds no step|limit of evaluations|solver\.step: got 1e-07 s, which makes 1000000 "
        r"steps of this call, expected at most",
    ):
        plant.step(0.1, Command(angle_ref=plant.robot.stance, push_force=np.array([1e8, 0.0, 0.0])))
    assert plant.save() == before


def test_a_call_that_spends_its_evaluations_says_so_and_changes_nothing(core: ct.CDLL) -> None:
    """Feet start 1 mm deep in a ground whose stiffness is absurd but in range. A call of 2 ms has
    20,200 attempts of 4 stages each.
    """
    robot = changed(load_robot("athena"), contact={"stiffness": 1e12})
    plant = Plant(core, robot, position=np.array([0.0, 0.0, 0.13]))
    before = plant.save()
    with pytest.raises(PlantError, match=r"limit of evaluations is spent .* 80800 evaluations"):
        plant.step(0.002)
    assert plant.save() == before


@pytest.mark.parametrize("release", [False, True])
def test_a_call_that_fails_at_once_restores_what_it_changed_before(
    core: ct.CDLL, release: bool
) -> None:
    """The call follows coordinates that were set, or releases a joint, which loses energy."""
    plant = Plant(core, load_robot("athena"))
    lock = np.zeros((6, 3))
    lock[0, 1] = 1.0
    plant.step(0.05, lock=lock)
    if not release:
        plant.coordinates = plant.coordinates + 1e-6
    before = plant.save()
    command = Command(angle_ref=plant.robot.stance, push_force=np.array([1e8, 0.0, 0.0]))
    with pytest.raises(PlantError, match=r"finds no step|limit of evaluations"):
        plant.step(plant.time + 0.1, command, None if release else lock)
    assert plant.save() == before
