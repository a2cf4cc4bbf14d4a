"""Writes and reads recordings: CSV for spreadsheets, Parquet, MCAP for tools of robots, and the
commands alone for importers.

CSV needs no package; Parquet and MCAP need the extras `parquet` and `logs`. A Parquet file has a
column of doubles per variable, with unit and description as metadata of each field and the run's
facts as metadata of the schema. A CSV file has "name [unit]" above each column. An MCAP file has
ROS 2 messages (cosim/logs). All hold the same numbers, bit for bit.
"""

from __future__ import annotations

import csv
import json
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from hexapod_cosim.cosim.common.files import atomic_path
from hexapod_cosim.cosim.common.installation import has_pyarrow, require_pyarrow
from hexapod_cosim.cosim.logs.mcap_reader import read_mcap
from hexapod_cosim.cosim.logs.mcap_writer import OURS, check_start, write_mcap
from hexapod_cosim.cosim.logs.messages import require_mcap
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.columns import (
    bare_name,
    heading,
    known_columns,
    plant_variables,
    wrong_unit,
)
from hexapod_cosim.cosim.scenario.records import default_formats
from hexapod_cosim.models import HexapodError
from hexapod_cosim.models.records import JointNames

COMMANDS = "commands.csv"


def write_recording(
    recording: Recording,
    folder: Path,
    stem: str,
    *,
    formats: Sequence[str] | None = None,
    columns: Sequence[str] = ("*",),
    about: Mapping[str, Any] | None = None,
    torso_com: Sequence[float] = (0.0, 0.0, 0.0),
    joints: JointNames = OURS,
) -> list[Path]:
    """Writes STEM.parquet and STEM.mcap with all columns and STEM.csv, as far as wanted; returns
    the files.

    Args:
        recording: what to write.
        folder: where to write it.
        stem: name of the files without suffix.
        formats: which of "parquet", "csv" and "mcap" to write; None: the default of
            scenarios.
        columns: patterns of the columns of the CSV file.
        about: facts of the run, texts or JSON values; metadata of all files but CSV.
        torso_com: centre of mass in the torso's frame [m], for the transforms of MCAP.
        joints: names and signs of the robot's joints, for MCAP.
    """
    facts = _texts(about or {})
    chosen = default_formats() if formats is None else formats
    files = [folder / f"{stem}.{kind}" for kind in chosen]
    for path in files:
        if path.suffix == ".parquet":
            write_parquet(recording, path, about=facts)
        elif path.suffix == ".mcap":
            write_mcap(recording, path, about=facts, torso_com=torso_com, joints=joints)
        else:
            write_csv(recording.chosen(columns), path, units=True)
    return files


def check_formats(formats: Sequence[str], *, start: float, where: str) -> None:
    """Raises HexapodError when a run that starts at a time [s] cannot be written in a format.

    It is called before a run, whose recording would be lost otherwise.
    """
    if "parquet" in formats:
        require_pyarrow("parquet", where)
    if "mcap" in formats:
        require_mcap(where)
        check_start(start, where)


def _texts(facts: Mapping[str, Any]) -> dict[str, str]:
    """Returns facts as texts: JSON of all that are none."""
    return {
        key: value if isinstance(value, str) else json.dumps(value, sort_keys=True)
        for key, value in facts.items()
    }


def write_commands(recording: Recording, path: Path) -> None:
    """Writes the plant's inputs over time under their bare names, as FMU importers read them.

    Each row holds until the next.
    """
    names = set(recording.names)
    inputs = ["time", *(name for name in plant_variables("input") if name in names)]
    write_csv(Recording(tuple(inputs), recording.columns(inputs)), path)


def read_recording(folder: Path, stem: str) -> Recording:
    """Reads a run's recording from its folder, in whichever format is there.

    Raises HexapodError when there is none.
    """
    for kind, read in READERS.items():
        if (folder / f"{stem}.{kind}").is_file():
            return read(folder / f"{stem}.{kind}")
    expected = " or ".join(f"{stem}.{kind}" for kind in READERS)
    raise HexapodError(
        "no recording",
        got=str(folder),
        expected=f"a folder with {expected}",
        fix="record it again, by `hexapod simulate` or from the robot",
    )


def write_parquet(recording: Recording, path: Path, *, about: Mapping[str, Any]) -> None:
    """Writes one column per variable. A failed write leaves no partial file.

    about: texts or JSON values for the metadata.
    """
    require_pyarrow("parquet", path)
    import pyarrow.parquet as pq  # noqa: PLC0415  slow to import

    table = _arrow_table(recording, _texts(about))
    # a file object: pyarrow takes no path with bytes that are no UTF-8
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        # byte-stream split halves the size of dictionary encoding, in a quarter of its time
        pq.write_table(
            table, file, compression="zstd", use_dictionary=False, use_byte_stream_split=True
        )


def _arrow_table(recording: Recording, facts: Mapping[str, str]) -> Any:
    """Returns a table with a column per variable, and the facts as metadata."""
    import pyarrow as pa  # noqa: PLC0415  slow to import

    known = known_columns()
    fields = [
        pa.field(
            name,
            pa.float64(),
            nullable=False,
            metadata=vars(known[name]) if name in known else None,
        )
        for name in recording.names
    ]
    columns = [pa.array(values) for values in np.ascontiguousarray(recording.data.T)]
    return pa.Table.from_arrays(columns, schema=pa.schema(fields, metadata=facts))


def read_parquet(path: Path) -> Recording:
    """Reads a recording from a Parquet file. Raises HexapodError for a missing or damaged file."""
    require_pyarrow("parquet", path)
    import pyarrow as pa  # noqa: PLC0415  slow to import
    import pyarrow.parquet as pq  # noqa: PLC0415

    try:
        with path.open("rb") as file:
            table = pq.read_table(file)
        table = table.cast(pa.schema([(name, pa.float64()) for name in table.column_names]))
    except (OSError, ValueError, NotImplementedError) as error:
        raise _not_a_recording(path, error, "Parquet with columns of numbers") from error
    columns = np.empty((table.num_columns, table.num_rows))
    for column, values in zip(columns, table.columns, strict=True):
        column[:] = values.to_numpy()
    return _recording(table.column_names, columns.T, path)


def write_csv(recording: Recording, path: Path, *, units: bool = False) -> None:
    """Writes a header of quoted names and one line per row; numbers read back bit for bit.

    A failed write leaves no partial file.
    """
    names = [heading(name) if units else name for name in recording.names]
    header = ",".join('"' + name.replace('"', '""') + '"' for name in names)
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        file.write(header.encode() + b"\n")
        if has_pyarrow():  # a quarter of the time
            import pyarrow.csv as pc  # noqa: PLC0415  slow to import

            options = pc.WriteOptions(include_header=False)
            pc.write_csv(_arrow_table(recording, {}), file, options)
        else:
            for row in recording.data.tolist():
                file.write((",".join(map(repr, row)) + "\n").encode())


def read_csv(path: Path) -> Recording:
    """Reads a recording from a CSV file with or without units in the header.

    Raises HexapodError for a missing or damaged file, and for a known column in another unit.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            names = next(csv.reader(file))
            rows = _rows(file, len(names))
    except (OSError, ValueError, StopIteration, csv.Error) as error:
        raise _not_a_recording(path, error, "a header and rows of numbers") from error
    for name in names:
        unit = wrong_unit(name)
        if unit:
            raise HexapodError(
                "a column in another unit",
                got=name,
                expected=f"{bare_name(name)} [{unit}]",
                fix="convert its numbers; a heading without a unit counts as this one",
                where=str(path),
            )
    return _recording([bare_name(name) for name in names], rows, path)


def _rows(file: TextIO, columns: int) -> np.ndarray:
    """Returns the rows of numbers of a CSV file after its header, (rows, columns).

    Raises ValueError for a text and for another number of columns.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "loadtxt: input contained no data", UserWarning)
        rows = np.loadtxt(file, delimiter=",", comments=None, quotechar='"', ndmin=2)
    if rows.size == 0:
        return np.empty((0, columns))
    if rows.shape[1] != columns:
        raise ValueError(f"expected {columns} columns, got {rows.shape[1]}")
    return rows


def _recording(names: Sequence[str], rows: np.ndarray, path: Path) -> Recording:
    """Returns the recording of a file's columns. Raises HexapodError unless time is the first."""
    if not names or names[0] != "time":
        raise HexapodError(
            "not a recording",
            got=f"first column {names[0] if names else ''!r}",
            expected="time first",
            fix="name the column of the times `time` [s] and put it first",
            where=str(path),
        )
    return Recording(tuple(names), rows)


def _not_a_recording(path: Path, error: Exception, expected: str) -> HexapodError:
    what, got = "not a recording", " ".join(str(error).split()) or "an empty file"
    if isinstance(error, FileNotFoundError | IsADirectoryError | PermissionError):
        what, got, expected = "no recording", str(error.strerror), f"a file {path.name} of a run"
    fix = "record it again, by `hexapod simulate` or from the robot"
    return HexapodError(what, got=got, expected=expected, fix=fix, where=str(path))


READERS: Mapping[str, Callable[[Path], Recording]] = {  # the faster one first
    "parquet": read_parquet,
    "csv": read_csv,
    "mcap": read_mcap,
}
