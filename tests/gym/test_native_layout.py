"""Tests the structures that Python reads from the co-simulation library's headers, and instances
that use a work space of the caller's.
"""

from __future__ import annotations

import ctypes
import ctypes as ct
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from building import shared_library
from fmi_plant import ATHENA, ERROR, OK, Plant

from hexapod_cosim.cosim.common.plant_files import fmi_headers
from hexapod_cosim.cosim.master import loop_library
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.loop_library import HEADERS, ORDER
from hexapod_cosim.extensions.gym import native
from hexapod_cosim.extensions.gym.batch import Batch
from hexapod_cosim.extensions.gym.settings import BLOCKS, REASONS, TERMS, EnvSettings
from hexapod_cosim.models import FmuError

ALIGNMENT = 64
REFUSED = 1  # HX_INVALID_ARGUMENT


class Work:
    """An aligned work space of the size that a binary asks for."""

    def __init__(self, library: Path) -> None:
        dll = ct.CDLL(str(library))
        dll.hx_shared_work_size.restype = ct.c_size_t
        self.size = int(dll.hx_shared_work_size())
        self._block = ct.create_string_buffer(self.size + ALIGNMENT)
        first = ct.addressof(self._block)
        self.address = first + -first % ALIGNMENT

    def stain(self, byte: int) -> None:
        """Overwrites all of it."""
        ct.memset(self.address, byte, self.size)


@pytest.fixture
def work(plant_library: Path) -> Work:
    return Work(plant_library)


@pytest.fixture
def pair(plant_library: Path) -> Iterator[tuple[Plant, Plant]]:
    """Two running instances."""
    with Plant(plant_library).initialize() as first, Plant(plant_library).initialize() as second:
        yield first, second


def use(plant: Plant, address: int | None, size: int) -> int:
    return plant.call("hx_shared_work_use", ct.c_void_p(address), ct.c_size_t(size))


def stepped(plant: Plant, step: int, angle: float) -> list[float]:
    """Steps with an input of its own and returns all outputs."""
    assert plant.set_reals({"LM.femur.angle_ref": angle, "RF.coxa.angle_ref": angle}) == OK
    assert plant.step(0.02 * step, 0.02) == OK, plant.last_message
    return plant.everything()


@pytest.mark.parametrize("byte", [0x00, 0xFF])
def test_instances_that_share_a_work_space_have_the_bits_of_instances_that_do_not(
    plant_library: Path, pair: tuple[Plant, Plant], work: Work, byte: int
) -> None:
    with Plant(plant_library).initialize() as alone, Plant(plant_library).initialize() as other:
        for plant in pair:
            assert use(plant, work.address, work.size) == OK
        for step in range(8):
            work.stain(byte)
            assert stepped(pair[0], step, 0.4) == stepped(alone, step, 0.4)
            work.stain(byte)
            assert stepped(pair[1], step, -0.3) == stepped(other, step, -0.3)


@pytest.mark.parametrize(
    ("shift", "missing", "said"),
    [(0, 1, "work space: got "), (8, 0, "8 bytes above a multiple of 64")],
)
def test_memory_that_is_too_small_or_not_aligned_is_refused_and_changes_nothing(
    pair: tuple[Plant, Plant], work: Work, shift: int, missing: int, said: str
) -> None:
    assert use(pair[0], work.address + shift, work.size - missing) == REFUSED
    assert said in pair[0].last_message
    assert str(work.size) in pair[0].last_message
    work.stain(0x55)
    before = ct.string_at(work.address, work.size)
    for step in range(3):
        assert stepped(pair[0], step, 0.3) == stepped(pair[1], step, 0.3)
    assert ct.string_at(work.address, work.size) == before


def test_a_controller_has_no_work_space(plant_build: Path) -> None:
    library = ct.CDLL(str(shared_library(plant_build, "controller/fmu", "hexapod_controller")))
    library.hx_shared_work_size.restype = ct.c_size_t
    assert library.hx_shared_work_size() == 0


def test_a_refused_step_restores_the_state_from_a_shared_work_space(
    pair: tuple[Plant, Plant], work: Work
) -> None:
    assert use(pair[0], work.address, work.size) == OK
    for plant in pair:
        stepped(plant, 0, 0.3)
    assert pair[0].step(0.5, 0.02) == ERROR
    work.stain(0x11)
    assert stepped(pair[0], 1, 0.3) == stepped(pair[1], 1, 0.3)


def test_saved_states_do_not_depend_on_the_work_space(
    pair: tuple[Plant, Plant], work: Work
) -> None:
    saved = []
    assert use(pair[0], work.address, work.size) == OK
    for plant in pair:
        stepped(plant, 0, 0.3)
        state = plant.save()
        saved.append(plant.serialize(state))
        plant.free(state)
    assert saved[0] == saved[1]
    status, state = pair[1].deserialize(saved[0])
    assert status == OK
    assert pair[1].call("fmi2SetFMUstate", state) == OK
    pair[1].free(state)
    work.stain(0x22)
    assert stepped(pair[0], 1, 0.1) == stepped(pair[1], 1, 0.1)


def test_every_mode_may_change_the_work_space(plant_library: Path, work: Work) -> None:
    with Plant(plant_library) as plant, Plant(plant_library).initialize() as other:
        assert use(plant, work.address, work.size) == OK
        work.stain(0xFF)
        plant.initialize()
        assert stepped(plant, 0, 0.2) == stepped(other, 0, 0.2)
        assert plant.call("fmi2Reset") == OK
        assert use(plant, None, 0) == OK
        plant.initialize()
        assert plant.reals(["torso.position[3]"]) == [ATHENA.variable("initial.position[3]").start]


def walk(threads: int, count: int = 7) -> list[bytes]:
    """Returns the observations and rewards of robots that fall, are pushed and begin again."""
    settings = EnvSettings(duration=0.4, push_force=20.0, randomise={"friction.mu": (0.4, 0.9)})
    found = []
    with Batch(settings, count, threads=threads) as batch:
        batch.reset(seeds=range(count))
        for step in range(30):
            numbers = np.random.default_rng(step).standard_normal((count, 18))
            batch.action[:] = 0.4 * numbers
            batch.step()
            found += [batch.observation.tobytes(), batch.reward.tobytes()]
    return found


ADDRESS = Fmu.address


def without_work(fmu: Fmu, name: str) -> int:
    """The addresses of a foreign FMU's functions."""
    return 0 if name.startswith("hx_") else ADDRESS(fmu, name)


@pytest.mark.usefixtures("plant_build")
def test_environments_with_a_foreign_plant_and_any_number_of_threads_have_the_same_bits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shared = walk(threads=1)
    assert walk(threads=3) == shared
    monkeypatch.setattr(Fmu, "address", without_work)
    assert walk(threads=3) == shared


# The structures that Python reads from the headers of the co-simulation library are those of the
# compiler; a library with others is refused.

ROOT = Path(__file__).parents[2]
HEADER = native.HEADER
STRUCTURES = {
    name: kind for name, kind in HEADER.types.items() if kind and issubclass(kind, ctypes.Structure)
}


def compile_c(text: str, *options: str | Path, folder: Path) -> None:
    """Compiles a source. Skips the test without a compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    source = folder / "source.c"
    source.write_text(text)
    subprocess.run([compiler, *options, source], check=True)


def test_python_reads_the_sizes_and_places_of_the_compiler(tmp_path: Path) -> None:
    lines = [f'#include "hexapod/{name}"' for name in (*ORDER, native.PATH.name)]
    for name, structure in STRUCTURES.items():
        lines.append(f'_Static_assert(sizeof({name}) == {ctypes.sizeof(structure)}, "{name}");')
        lines += [
            f"_Static_assert(offsetof({name}, {member}) == {getattr(structure, member).offset} && "
            f"sizeof((({name} *)0)->{member}) == {getattr(structure, member).size}, "
            f'"{name}.{member}");'
            for member, _ in structure._fields_
        ]
    lines += [
        f'_Static_assert({name} == {number}, "{name}");'
        for name, number in HEADER.constants.items()
    ]
    folders = [
        HEADERS.parent,
        native.PATH.parents[1],
        ROOT / "plant_fmu" / "include",
        fmi_headers(),
    ]
    options = [f"-I{folder}" for folder in folders]
    compile_c("\n".join(lines), "-std=c11", "-fsyntax-only", *options, folder=tmp_path)


def test_python_lists_the_names_of_the_header_in_their_order() -> None:
    names = {
        "HX_SEE_": tuple(BLOCKS),
        "HX_TERM_": TERMS,
        "HX_END_": ("none", *REASONS[1:]),
        "HX_AUTORESET_": native.AUTORESET,
    }
    for prefix, expected in names.items():
        found = [name for name in HEADER.constants if name.startswith(prefix)]
        assert tuple(name.removeprefix(prefix).lower() for name in found) == expected


@pytest.mark.parametrize(
    ("part", "size", "structure", "load"),
    [
        ("master", "hx_master_size", "hxMaster", loop_library.master_library.__wrapped__),
        (
            "environments",
            "hx_environments_settings_size",
            "hxEnvSettings",
            native.environments_library.__wrapped__,
        ),
    ],
)
def test_a_library_with_another_layout_is_refused(
    part: str,
    size: str,
    structure: str,
    load: Callable[[], ctypes.CDLL],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bytes_ = ctypes.sizeof(STRUCTURES[structure])
    number = HEADER.constants[f"HX_{part.upper()}_LAYOUT"]
    sized = "unsigned long {}(void) {{ return {}; }} int hx_{}_layout(void) {{ return {}; }}"
    cases = {
        "layout 0 of 0 bytes": "int other;",
        f"layout 77 of {bytes_} bytes": sized.format(size, bytes_, part, 77),
        f"layout {number} of 8 bytes": sized.format(size, 8, part, number),
    }
    for place, (said, text) in enumerate(cases.items()):
        library = tmp_path / f"stale{place}.so"
        compile_c(text, "-shared", "-fPIC", "-o", library, folder=tmp_path)
        monkeypatch.setattr(loop_library, "shared_library", lambda _, found=library: found)
        with pytest.raises(FmuError, match="another version's") as caught:
            load()
        assert f"got {said!r}, expected layout {number} of {bytes_} bytes" in str(caught.value)
        assert "pip install" in str(caught.value)
