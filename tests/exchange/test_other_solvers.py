"""Tests that other solvers find the same motion by model exchange as co-simulation does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exchange_calls import LEGS, STATES, solved_by_cvode
from fmpy import simulate_fmu

THROWN = {
    "initial.position[3]": 0.15,
    "initial.velocity[1]": 0.2,
    "initial.angular_velocity[2]": 0.5,
}
CONVERGED = 2e-9  # m, rad; both solvers have 1e-9, and twelve touch-downs amplify the difference


@pytest.mark.parametrize("law", ["tanh", "bristle"])
def test_another_solver_finds_the_same_motion(athena_fmu: Path, law: str) -> None:
    names = [
        *STATES[:7],
        *(f"{leg}.{joint}.angle" for leg in LEGS for joint in ("coxa", "femur", "tibia")),
        "solver.touchdowns",
    ]
    start = THROWN | {"solver.tolerance": 1e-10, "friction.law": {"tanh": 1, "bristle": 3}[law]}
    asked = {"start_values": start, "stop_time": 0.12, "output_interval": 0.01, "output": names}
    ours = simulate_fmu(str(athena_fmu), fmi_type="CoSimulation", **asked)
    theirs = solved_by_cvode(athena_fmu, 1e-10, **asked)
    assert ours["solver.touchdowns"][-1] == theirs["solver.touchdowns"][-1] >= 8
    for name in names[:-1]:
        np.testing.assert_allclose(theirs[name], ours[name], atol=CONVERGED, err_msg=name)


def test_measures_with_another_solver_equal_those_of_co_simulation(athena_fmu: Path) -> None:
    """fmpy calls fmi2CompletedIntegratorStep at every output; the measures follow the path between
    these calls.
    """
    summed = ("positive_work", "negative_work", "torque_squared")
    names = [
        f"{leg}.{joint}.{name}"
        for name in summed
        for leg in LEGS
        for joint in ("coxa", "femur", "tibia")
    ]
    names += [
        f"{leg}.foot.{name}" for name in ("impulse", "slip_distance", "landings") for leg in LEGS
    ]
    names += ["energy.contact_loss", "energy.friction_loss", "energy.gear_loss"]
    asked = {
        "start_values": THROWN | {"solver.tolerance": 1e-8},
        "stop_time": 0.12,
        "output": names,
    }
    ours = simulate_fmu(str(athena_fmu), fmi_type="CoSimulation", output_interval=0.005, **asked)
    exchange = {
        "fmi_type": "ModelExchange",
        "solver": "CVode",
        "relative_tolerance": 1e-8,
        "record_events": False,
    }
    theirs = simulate_fmu(str(athena_fmu), output_interval=2e-4, **exchange, **asked)
    for name in (
        *summed,
        "impulse",
        "slip_distance",
        "landings",
        "contact_loss",
        "friction_loss",
        "gear_loss",
    ):
        sums = [
            sum(run[full][-1] for full in names if full.endswith(f".{name}"))
            for run in (ours, theirs)
        ]
        assert sums[1] == pytest.approx(sums[0], rel=0.01), name
        assert sums[0] > 0.0, name


def folded(position: float) -> dict[str, float]:
    """Returns the start of an upturned robot with folded legs whose joints are held."""
    start = {"initial.position[3]": position}
    for k, value in enumerate((0.0, 1.0, 0.05, 0.02)):
        start[f"initial.quaternion[{k + 1}]"] = value
    for leg in LEGS:
        for joint, angle in (("coxa", 0.0), ("femur", -0.3), ("tibia", 0.2)):
            start[f"initial.{leg}.{joint}.angle"] = start[f"{leg}.{joint}.angle_ref"] = angle
    return start


def meeting() -> dict[str, float]:
    """Returns the start of a floating robot whose legs LF and LM turn towards each other."""
    start = {"initial.position[3]": 1.0, "gravity[3]": 0.0, "body.self_contact": 3.0}
    for leg, side, bend in (("LF", 1.0, 0.386), ("LM", -1.0, 0.536)):
        start[f"initial.{leg}.coxa.angle"] = 0.55 * side
        start[f"initial.{leg}.femur.angle"] = start[f"{leg}.femur.angle_ref"] = bend
        start[f"{leg}.coxa.angle_ref"] = 0.8 * side
    return start


@pytest.mark.parametrize("start", [folded(0.08), meeting()], ids=["torso", "legs"])
def test_contacts_of_bodies_and_legs_are_events_of_the_importer(
    athena_fmu: Path, start: dict[str, float]
) -> None:
    """The energy books of a drop on the back and of colliding legs close in model exchange, and the
    losses are those of co-simulation.
    """
    asked: dict[str, Any] = {"start_values": start, "stop_time": 0.2, "output_interval": 0.01}
    asked["output"] = ["energy.residual", "energy.contact_loss", "energy.dissipated"]
    solver = {"solver": "CVode", "relative_tolerance": 1e-7}
    theirs = simulate_fmu(str(athena_fmu), fmi_type="ModelExchange", **solver, **asked)
    ours = simulate_fmu(str(athena_fmu), fmi_type="CoSimulation", **asked)
    assert len(theirs) > len(ours)  # rows at events
    lost = float(ours["energy.dissipated"][-1])
    assert float(ours["energy.contact_loss"][-1]) > 1e-3
    assert abs(float(theirs["energy.residual"][-1])) < 1e-3 * lost
    assert float(theirs["energy.dissipated"][-1]) == pytest.approx(lost, rel=2e-2)
