"""Elastic gears with play: a rotor and a link against their closed forms and an independent
integration, the limit of a rigid gear, the energy book, saved states, and the twin.
"""

from __future__ import annotations

import ctypes as ct
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmi_plant import ERROR, MODEL_EXCHANGE, OK
from fmi_plant import Plant as FmuPlant
from plant import Plant, PlantError
from scipy.integrate import solve_ivp
from states import changed, distance, landing, lopsided, random_bodies, random_command
from test_laws_servo import tibia_inertia, tibias, walled
from test_measured_servos import with_servo

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.contact.geometry import standing_damping
from hexapod_cosim.models.dynamics import Command, accelerations
from hexapod_cosim.models.energy import kinetic_energy, potential_energy
from hexapod_cosim.models.integrator import Start, State, end_step, start_state, try_step
from hexapod_cosim.models.records import Array

CLOSED = 1e-8  # rad, rad/s  of closed forms: a tibia's inertia is 1e-7 of its wall's
AGREES = 1e-6  # of an independent integration
DENSE = 1e-9  # relative, of the sweeps and the dense system
TWIN = 1e-11  # relative, of steps
ELASTIC: dict[str, Any] = {"gear_stiffness": 400.0, "gear_damping": 0.05}


def rod(**servo: Any) -> tuple[Robot, float, float]:
    """Returns a robot on a wall, and the inertias of its rotors and of its tibias [kg m2]."""
    robot = walled(**{"torque_max": 100.0, "speed_max": 1e6} | servo)
    rotor = robot.servo.rotor_inertia
    return robot, rotor, tibia_inertia(robot) - rotor


def knee(plant: Plant, command: Command) -> Array:
    """Returns angle, deflection and the rotor's speed of a knee [rad, rad, rad/s]."""
    output = plant.output(command)
    found = [output.angle, output.gear_deflection, output.motor_speed]
    assert all(np.ptp(values[:, 2]) < 1e-6 for values in found)
    return np.array([values[1, 2] for values in found])


def turned_up(t: float, torque: float, rotor: float, tibia: float, **gear: float) -> Array:
    """Returns angle, deflection and rotor speed of two inertias on a spring and a damper, at rest
    at first, under a constant torque on the rotor.
    """
    inverse = 1.0 / rotor + 1.0 / tibia
    square, decay = gear["stiffness"] * inverse, 0.5 * gear["damping"] * inverse
    w = math.sqrt(square - decay**2)
    rest, fade = torque / rotor / square, math.exp(-decay * t)
    deflection = rest * (1.0 - fade * (math.cos(w * t) + decay / w * math.sin(w * t)))
    rate = rest * fade * square / w * math.sin(w * t)
    whole = rotor + tibia
    angle = (0.5 * torque * t**2 - rotor * deflection) / whole
    return np.array([angle, deflection, (torque * t + tibia * rate) / whole])


@pytest.mark.parametrize("damping", [0.0, 0.5])
@pytest.mark.parametrize(("method", "tolerance"), [("dp54", 1e-10), ("rosw3", 1e-9)])
def test_a_rotor_and_a_link_swing_against_each_other_as_two_masses_on_a_spring(
    core: ct.CDLL, method: str, tolerance: float, damping: float
) -> None:
    gear = {"gear_stiffness": 400.0, "gear_damping": damping}
    robot, rotor, tibia = rod(mode="torque", **gear)
    robot = changed(robot, solver={"method": method, "tolerance": tolerance})
    plant, torque = Plant(core, robot, angle=tibias(0.1)), 0.5
    command = Command(angle_ref=np.zeros((6, 3)), torque_ref=tibias(torque))
    for t in (0.002, 0.0071, 0.02):
        plant.step(t, command)
        exact = turned_up(t, torque, rotor, tibia, stiffness=400.0, damping=damping)
        error = knee(plant, command) - exact - [0.1, 0.0, 0.0]
        assert np.abs(error[:2]) == pytest.approx([0.0, 0.0], abs=CLOSED)
        assert error[2] == pytest.approx(0.0, abs=1e-6 * abs(exact[2]) + CLOSED)
    assert plant.output(command).energy.residual == pytest.approx(0.0, abs=1e-12)


# play, against an independent integration


def meets(deflection: float, play: float) -> tuple[float, float]:
    """Returns the teeth's deflection and its derivative, by the cases of eq. 55."""
    edge = 0.05 * play
    past = abs(deflection) - 0.5 * play
    if past <= -edge:
        return 0.0, 0.0
    if past < edge:
        return math.copysign((past + edge) ** 2 / (4.0 * edge), deflection), (past + edge) / (
            2.0 * edge
        )
    return math.copysign(past, deflection), 1.0


def swung(
    servo: dict[str, float], tibia: float, rotor: float, target: list[tuple[float, float]]
) -> list[Array]:
    """Returns angle, deflection and rotor speed of a servo and its link at the ends of targets,
    (time [s], commanded angle [rad]), by DOP853.
    """

    def rate(_: float, y: Array, told: float) -> list[float]:
        angle, speed, deflection, motor = y
        x, share = meets(deflection, servo["backlash"])
        gear = servo["gear_stiffness"] * x + servo["gear_damping"] * share * (motor - speed)
        load = motor / servo["speed_max"]
        low, high = (min(max(1.0 + sign * load, 0.0), 1.0) for sign in (1.0, -1.0))
        torque = servo["kp"] * (told - angle) - servo["kd"] * motor
        torque = min(max(torque, -servo["torque_max"] * low), servo["torque_max"] * high)
        torque -= servo["coulomb_friction"] * math.tanh(motor / 0.05)
        return [speed, gear / tibia, motor - speed, (torque - gear) / rotor]

    y, start, found = np.array([0.1, 0.0, 0.0, 0.0]), 0.0, []
    for end, told in target:
        accuracy = {"rtol": 1e-11, "atol": 1e-13, "max_step": 2e-3}
        y = solve_ivp(rate, (start, end), y, "DOP853", args=(told,), **accuracy).y[:, -1]
        found.append(y[[0, 2, 3]])
        start = end
    return found


@pytest.mark.parametrize(
    ("play", "damping", "ends"), [(0.0, 0.05, 0.5), (0.004, 0.05, 0.25), (0.02, 0.5, 0.5)]
)
def test_a_servo_with_play_follows_an_independent_integration(
    core: ct.CDLL, play: float, damping: float, ends: float
) -> None:
    servo = {
        "gear_stiffness": 400.0,
        "gear_damping": damping,
        "backlash": play,
        "kp": 40.0,
        "kd": 0.8,
        "coulomb_friction": 0.05,
        "torque_max": 6.0,
        "speed_max": 6.6,
    }
    robot, rotor, tibia = rod(**servo)
    plant = Plant(core, robot, angle=tibias(0.1))
    target = [(0.1, 0.3), (0.25, -0.1), (0.5, 0.0)]
    widest = 0.0
    for (end, told), exact in zip(target, swung(servo, tibia, rotor, target), strict=True):
        if end > ends:
            break
        command = Command(angle_ref=tibias(told))
        plant.step(end, command)
        found = knee(plant, command)
        assert found[:2] == pytest.approx(exact[:2], abs=AGREES)
        assert found[2] == pytest.approx(exact[2], abs=10.0 * AGREES)
        widest = max(widest, abs(found[1]))
    assert widest >= 0.3 * play
    assert plant.output(command).energy.residual == pytest.approx(0.0, abs=1e-11)


# the rigid limit


def moved(core: ct.CDLL, **servo: float) -> tuple[Array, float]:
    """Returns angles of a knee after two commands [rad], and the number of steps."""
    drive = {"kp": 40.0, "kd": 0.8, "coulomb_friction": 0.05, "torque_max": 6.0, "speed_max": 6.6}
    robot, _, _ = rod(**drive, **servo)
    robot = changed(robot, solver={"method": "rosw3", "tolerance": 1e-8})
    plant, found = Plant(core, robot, angle=tibias(0.1)), []
    for end, told in ((0.05, 0.3), (0.1, -0.1)):
        plant.step(end, Command(angle_ref=tibias(told)))
        found.append(float(plant.output().angle[1, 2]))
    return np.array(found), plant.output().solver.steps


def test_a_stiff_gear_converges_to_the_rigid_one_with_the_inverse_of_its_stiffness(
    core: ct.CDLL,
) -> None:
    rigid, _ = moved(core)
    errors = [
        float(np.max(np.abs(moved(core, gear_stiffness=k, gear_damping=0.3)[0] - rigid)))
        for k in (1e3, 1e4, 1e5)
    ]
    assert errors[0] == pytest.approx(1.19e-4, rel=0.02)
    assert [errors[0] / errors[1], errors[1] / errors[2]] == pytest.approx([10.0, 10.0], rel=0.15)


# the whole robot


def landed(core: ct.CDLL, robot: Robot, time: float = 0.1) -> Plant:
    """Returns a plant that has fallen onto the ground."""
    plant = Plant(core, robot, **landing(robot))
    for k in range(1, round(time / 0.005) + 1):
        plant.step(0.005 * k)
    return plant


def test_the_energy_book_closes_with_elastic_gears_and_play(core: ct.CDLL) -> None:
    residuals = []
    for tolerance in (1e-4, 1e-6):
        robot = with_servo(load_robot("athena"), "mx64_m6", backlash=0.01, **ELASTIC)
        plant = landed(core, changed(robot, solver={"tolerance": tolerance}))
        energy = plant.output().energy
        residuals.append(abs(energy.residual))
        output = plant.output()
        drives = np.sum(output.positive_work - output.negative_work)
        assert drives == pytest.approx(energy.actuator_work, abs=1e-9)
        assert float(np.max(np.abs(output.gear_deflection))) > 0.005
        assert energy.gear_loss > 0.01
    assert residuals[0] < 1e-3
    assert residuals[1] < 1e-5


@pytest.mark.parametrize(
    ("name", "mode", "gear"),
    [
        ("mx64_m6", "position", ELASTIC | {"backlash": 0.01}),
        ("mx64_m1", "torque", ELASTIC | {"gear_ratio": -60.0}),
        ("mx64_m1", "kinematic", {"gear_ratio": 60.0}),
    ],
)
def test_steps_with_elastic_gears_and_spinning_rotors_are_the_twins(
    core: ct.CDLL, name: str, mode: str, gear: dict[str, float]
) -> None:
    stops = {"stop_stiffness": 50.0, "stop_damping": 5.0}
    robot = with_servo(lopsided(3), name, mode=mode, **gear, **stops)
    h = 1e-4
    robot = changed(robot, solver={"step": h, "method": "rosw3"})
    body, command = random_bodies(robot, 5), random_command(robot, 5)
    plant, state = Plant(core, robot), start_state(robot, body)
    plant.bodies = body
    still = standing_damping(robot, body)
    ours = plant.accelerations(command)
    dense = accelerations(robot, body, command, still, rotors=state.rotors)
    assert distance(ours.dv, dense.dv) < DENSE
    assert distance(ours.multipliers, dense.multipliers) < DENSE
    assert distance(ours.drive_torque, dense.drive_torque) < DENSE
    for k in (1, 2):
        start = Start(robot, command, state)
        state = end_step(start, h, try_step(start, h))
        plant.step(k * h, command)
        assert_same(plant, state, command)


def assert_same(plant: Plant, state: State, command: Command) -> None:
    """Asserts that a plant and its twin have the same state and energy."""
    output = plant.output(command)
    assert distance(plant.bodies, state.body) < TWIN
    kinetic = kinetic_energy(plant.robot, state.body, state.rotors)
    potential = potential_energy(plant.robot, state.body, state.rotors)
    assert output.energy.kinetic == pytest.approx(kinetic, rel=TWIN)
    assert output.energy.potential == pytest.approx(potential, rel=TWIN)
    if state.rotors is None:
        return
    assert distance(output.gear_deflection, state.rotors.deflection) < TWIN
    assert distance(output.motor_speed, state.rotors.speed) < TWIN
    assert float(np.max(np.abs(output.gear_deflection))) > 1e-4


# refusals


def test_model_exchange_with_elastic_gears_is_refused(plant_library: Path) -> None:
    with FmuPlant(plant_library, kind=MODEL_EXCHANGE) as instance:
        assert instance.set_reals({"servo.gear_stiffness": 400.0}) == OK
        assert instance.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0) == OK
        assert instance.call("fmi2EnterInitializationMode") == OK
        assert instance.call("fmi2ExitInitializationMode") == ERROR
        assert "use co-simulation" in instance.last_message
        assert instance.call("fmi2Reset") == OK
        instance.initialize()


@pytest.mark.parametrize(
    ("servo", "message"),
    [
        ({"gear_stiffness": 100.0, "rotor_inertia": 0.0}, "servo.rotor_inertia"),
        ({"backlash": 0.01}, "servo.gear_stiffness"),
        ({"gear_ratio": 0.5}, "servo.gear_ratio"),
    ],
)
def test_impossible_gears_are_refused(core: ct.CDLL, servo: dict[str, float], message: str) -> None:
    robot = changed(load_robot("athena"), servo=servo)
    with pytest.raises(PlantError, match=message):
        Plant(core, robot)
