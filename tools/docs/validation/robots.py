"""Designs gains for robots drawn at random and unusual ones, and runs them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from random_robots import COUNT, draw_robot, hip_height, walk_of
from test_random_robots import odd_robots

from hexapod_cosim.cosim.design.gain_design import design_for
from hexapod_cosim.cosim.run.walker import Walker
from hexapod_cosim.cosim.scenario.records import COMPARED, Scenario
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.urdf.writer import robot_to_urdf
from tools.docs.validation.shown import Shown
from tools.docs.validation.walked import MILLI, changed

ALWAYS = (1, 4, 7)  # what `make test` walks
FIGURES = {
    "slip_per_metre": ("slip [m/m]", 1.0),
    "path_error": ("path error [mm/m]", MILLI),
    "peak_force": ("peak force [BW]", 1.0),
}
BOTH = ", ".join(COMPARED)
Walks = Iterator[tuple[str, Robot, Scenario]]


def walked() -> Shown:
    """Shows the robots of `make test`, the lightest and the heaviest one, and unusual ones."""
    rows = []
    with TemporaryDirectory() as folder, Walker() as walker:
        for title, robot, scenario in (*_drawn(Path(folder)), *_odd(Path(folder))):
            gains = design_for(robot, scenario.macro_step)
            plans = [replace(scenario, control=name) for name in COMPARED]
            pair = [walker.summary(plan, gains=gains) for plan in plans]
            cells = [
                changed(scale * each.metrics[key] for each in pair)
                for key, (_, scale) in FIGURES.items()
            ]  # fmt: skip
            size = f"{robot.total_mass:.2f}", f"{MILLI * hip_height(robot):.0f}"
            walks = ", ".join(each.control for each in pair if each.walked)
            rows.append((title, *size, "both" if walks == BOTH else walks, *cells))
    headings = ("robot", "mass [kg]", "hips [mm]", "walks under")
    return Shown(columns=(*headings, *(title for title, _ in FIGURES.values())), rows=rows)


def _drawn(folder: Path) -> Walks:
    robots = {number: draw_robot(number, folder) for number in range(COUNT)}
    masses = {number: robot.total_mass for number, (_, robot) in robots.items()}
    ends = min(masses, key=masses.__getitem__), max(masses, key=masses.__getitem__)
    for number in sorted({*ALWAYS, *ends}):
        path, robot = robots[number]
        yield f"no. {number} of {COUNT}", robot, walk_of(robot, path, "compliant")


def _odd(folder: Path) -> Walks:
    scenario = load_scenario("walk_flat", overrides=["servo.kp=28", "duration=8"])
    robot = load_robot("athena")
    soft = replace(robot, servo=replace(robot.servo, kp=28.0))
    yield "ATHENA-like, `servo.kp=28`", soft, scenario
    for odd in odd_robots():
        path = folder / f"{odd.name}.urdf"
        path.write_text(robot_to_urdf(odd), encoding="utf-8")
        how = odd.name.replace("_", " ").replace("athena times", "scaled by")
        yield f"ATHENA-like, {how}", odd, walk_of(odd, path, "compliant")


RESULTS: Mapping[str, Callable[[], Shown]] = {"robots": walked}
