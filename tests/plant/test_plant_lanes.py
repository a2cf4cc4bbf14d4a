"""Tests the plant's elementary functions and those of its lanes against numpy, and that the width
of lanes changes no bit.
"""

from __future__ import annotations

import ctypes as ct
import math
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plant import Plant, pointer
from states import changed, random_command, random_pose

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.soil.presets import soil_preset

SLOTS = 8
ULP = 2.0**-52
TANH_ULPS, EXPM1_ULPS, ANGLE_ULPS = (
    4.0,
    4.0,
    4.0,
)  # units in the last place: a few roundings each; no error of method is allowed
ROOT = Path(__file__).parents[2]
BASELINE = "-DHX_BASELINE_ONLY"  # without the kernels for other instruction sets
WIDTHS = {name: [BASELINE, f"-DHX_LANES={lanes}"] for name, lanes in (("scalar", 1), ("four", 4))}


def mapped(function: Callable[..., None], *arguments: Array) -> Array:
    out = np.empty_like(arguments[0])
    assert len(out) % SLOTS == 0
    function(
        *(pointer(np.ascontiguousarray(argument)) for argument in arguments), pointer(out), len(out)
    )
    return out


def ulps(got: Array, exact: Array) -> float:
    """Returns the largest error in units in the last place of the exact value."""
    return float(np.max(np.abs(got - exact) / np.spacing(np.abs(exact))))


def logarithmic(low: float, high: float, seed: int) -> Array:
    """Returns 4096 numbers of both signs whose sizes are spread evenly over the decades."""
    rng = np.random.default_rng(seed)
    sizes: Array = np.exp(rng.uniform(np.log(low), np.log(high), 4096)) * rng.choice(
        [-1.0, 1.0], 4096
    )
    return sizes


def ground(law: str) -> dict[str, dict[str, Any]]:
    """Returns the sections of a friction law, of spinning rotors, or of soil under the feet."""
    if law == "rotors":
        return {"servo": {"gear_ratio": 200.0}}
    if law != "soil":
        return {"friction": {"law": law}}
    return {"soil": asdict(soil_preset("sandy_loam").soil), "foot": {"pad_radius": 0.02}}


def test_tanh_is_right_to_a_few_last_places(core: ct.CDLL) -> None:
    x = logarithmic(1e-12, 300.0, 1)
    assert ulps(mapped(core.hx_probe_tanh, x), np.tanh(x)) <= TANH_ULPS


def test_tanh_saturates_to_exactly_one_and_is_odd(core: ct.CDLL) -> None:
    x = np.concatenate(
        [[0.0, 20.0, 50.0, 1e300, np.inf, 1e-300, 19.0, 5.0], logarithmic(1e-6, 50.0, 2)]
    )
    got, mirrored = mapped(core.hx_probe_tanh, x), mapped(core.hx_probe_tanh, -x)
    assert list(got[:5]) == [0.0, 1.0, 1.0, 1.0, 1.0]
    assert np.all(np.abs(got) <= 1.0)
    assert float(np.max(np.abs(got + mirrored))) <= 2.0 * ULP


def test_expm1_is_right_to_a_few_last_places(core: ct.CDLL) -> None:
    x = logarithmic(1e-12, 40.0, 3)
    assert ulps(mapped(core.hx_probe_expm1, x), np.expm1(x)) <= EXPM1_ULPS


def test_the_angle_of_a_half_angle_is_right_in_the_whole_turn(core: ct.CDLL) -> None:
    rng = np.random.default_rng(4)
    half, size = (
        rng.uniform(-np.pi / 2.0, np.pi / 2.0, 4096),
        rng.uniform(0.1, 10.0, 4096) * rng.choice([-1.0, 1.0], 4096),
    )
    y, x = size * np.sin(half), size * np.cos(half)
    assert ulps(mapped(core.hx_probe_angle_from_half, y, x), 2.0 * np.arctan(y / x)) <= ANGLE_ULPS


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("method", ["rosw3", "dp54"])
@pytest.mark.parametrize("law", ["tanh", "bristle", "soil", "rotors"])
def test_the_motion_does_not_depend_on_the_lane_width(
    core: ct.CDLL, other_cores: dict[str, ct.CDLL], width: str, method: str, law: str
) -> None:
    robot = changed(load_robot("phantomx_mk4"), solver={"method": method}, **ground(law))
    command, ends = random_command(robot, 5, size=0.3), (0.004, 0.02)
    plants = [
        Plant(library, robot, **random_pose(robot, 5)) for library in (core, other_cores[width])
    ]
    for t in ends:
        for plant in plants:
            plant.step(t, command)
    assert plants[0].save() == plants[1].save()
    here, there = (plant.accelerations(command) for plant in plants)
    assert np.array_equal(here.dv, there.dv)
    assert np.array_equal(here.multipliers, there.multipliers)
    assert bytes(plants[0].output_record(command)) == bytes(plants[1].output_record(command))


def test_every_kernel_of_this_build_that_runs_here_gives_the_same_rates(core: ct.CDLL) -> None:
    robot = changed(load_robot("athena"), servo={"mode": "kinematic"})
    plant, command = Plant(core, robot, **random_pose(robot, 6)), random_command(robot, 6, size=0.3)
    seen = plant.rates_of_kernels(command)
    assert "baseline" in seen
    assert all(np.array_equal(rate, seen["baseline"]) for rate in seen.values())
    assert np.count_nonzero(seen["baseline"]) > 100


@pytest.fixture(scope="session")
def other_cores(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ct.CDLL]:
    """Returns the plant compiled for other lane widths, and without the optimisation of the plant
    under test.
    """
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    assert compiler, "these tests need a C compiler"
    folder, plant = tmp_path_factory.mktemp("widths"), ROOT / "plant_fmu"
    sources = [
        str(path)
        for path in [*sorted((plant / "src").rglob("*.c")), plant / "generated" / "defaults.c"]
    ]
    flags = [
        "-std=c11",
        "-O0",
        "-shared",
        "-fPIC",
        "-ffp-contract=off",
        "-DHX_SHARED",
        f"-I{plant / 'include'}",
        f"-I{plant / 'src'}",
    ]
    libraries = {}
    for name, extra in WIDTHS.items():
        file = folder / f"{name}.so"
        subprocess.run(
            [compiler, *flags, *extra, *sources, "-lm", "-o", str(file)],
            check=True,
            capture_output=True,
        )
        libraries[name] = ct.CDLL(str(file))
    return libraries


# Tests the plant's sine, cosine, arc tangent, logarithm and power, which do not use libm so that
# every platform gives the same bits.

ROUND_OFF = 2.3e-16  # relative to 1
FEW_ULPS = 8e-16  # relative: a square root and two halvings of the angle before the polynomial
POWER = 1e-15  # relative: roundings of the logarithm's small part times the exponent
LOGARITHM = 4e-15  # relative: rounding of 1 + x and of twelve terms


@pytest.fixture(scope="module")
def arguments() -> np.ndarray:
    rng = np.random.default_rng(3)
    special = [
        0.0,
        1e-300,
        1e-9,
        0.25,
        -0.25,
        0.7,
        -0.999,
        1.0,
        math.pi / 4,
        math.pi / 2,
        math.pi,
        -math.pi,
        2 * math.pi,
        1e3,
    ]
    return np.concatenate(
        [
            special,
            rng.uniform(-7.0, 7.0, 4000),
            rng.uniform(-1.0, 0.5, 2000),
            10.0 ** rng.uniform(-12.0, 4.0, 1000),
        ]
    )


def evaluated(core: ct.CDLL, x: np.ndarray) -> tuple[np.ndarray, ...]:
    out = tuple(np.zeros_like(x) for _ in range(3))
    core.hx_probe_elementary(pointer(x), *map(pointer, out), len(x))
    return out


def test_sine_and_cosine_are_exact_to_one_unit_in_the_last_place_of_1(
    core: ct.CDLL, arguments: np.ndarray
) -> None:
    sine, cosine, _ = evaluated(core, arguments)
    assert np.max(np.abs(sine - np.sin(arguments))) <= ROUND_OFF
    assert np.max(np.abs(cosine - np.cos(arguments))) <= ROUND_OFF


def test_small_sines_are_exact_relative_to_themselves(core: ct.CDLL) -> None:
    x = np.concatenate(
        [10.0 ** np.linspace(-300.0, -1.0, 500), math.pi - 10.0 ** np.linspace(-9.0, -1.0, 500)]
    )
    sine, *_ = evaluated(core, x)
    assert np.max(np.abs(sine / np.sin(x) - 1.0)) <= 2 * ROUND_OFF


def test_the_logarithm_is_exact_to_a_few_units_in_the_last_place(
    core: ct.CDLL, arguments: np.ndarray
) -> None:
    x = arguments[(arguments > -1.0) & (arguments != 0.0)]
    *_, logarithm = evaluated(core, x)
    assert np.max(np.abs(logarithm / np.log1p(x) - 1.0)) <= LOGARITHM
    assert np.all(evaluated(core, np.zeros(1))[2] == 0.0)


def test_the_arc_tangent_is_that_of_the_quadrant(core: ct.CDLL) -> None:
    core.hx_probe_atan2.restype = ct.c_double
    rng = np.random.default_rng(4)
    points = [
        *rng.normal(size=(2000, 2)),
        *(rng.normal(size=(500, 2)) * 10.0 ** rng.uniform(-100.0, 100.0, (500, 2))),
    ]
    axes = [(y, x) for y in (0.0, -0.0, 1.0, -1.0, 1e-9) for x in (1.0, -1.0, 1e-9, -1e-9)]
    for y, x in [*points, *axes]:
        got, expected = core.hx_probe_atan2(ct.c_double(y), ct.c_double(x)), math.atan2(y, x)
        assert abs(got - expected) <= FEW_ULPS * abs(expected)
    assert core.hx_probe_atan2(ct.c_double(0.0), ct.c_double(0.0)) == 0.0


def powers(core: ct.CDLL, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    out = np.zeros_like(x)
    core.hx_probe_power(pointer(x), pointer(y), pointer(out), len(x))
    return out


def test_powers_are_exact_to_a_few_units_in_the_last_place(core: ct.CDLL) -> None:
    rng = np.random.default_rng(5)
    x = np.concatenate([10.0 ** rng.uniform(-12.0, 3.0, 4000), 10.0 ** rng.uniform(-300, -9, 500)])
    y = rng.uniform(-1.0, 3.0, len(x))
    y[4000:] = rng.uniform(-1.0, 1.0, 500)
    expected = np.array([math.pow(a, b) for a, b in zip(x, y, strict=True)])
    assert np.max(np.abs(powers(core, x, y) / expected - 1.0)) <= POWER
