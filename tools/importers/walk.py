"""Records the walk that every importer repeats: joint commands of a compliant walk, and the outputs
of fmpy's simulator under these commands.
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path

import fmpy
import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller import DEFAULT_PERIOD
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.interface.descriptions import read_description
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.recordings import read_csv, write_csv
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import load_robot

STEP = DEFAULT_PERIOD  # s


@dataclass(frozen=True, kw_only=True)
class ReferenceRun:
    """Files in one folder, and the expected outputs of an importer.

    reference: fmpy's outputs, a row for each communication point after the first.
    recorded: the outputs of the project's own master.
    """

    folder: Path
    fmu: Path
    inputs: Path  # CSV: time and commands, which hold until the next row
    wanted: Path  # names of the outputs to read, one on each line
    reference: Recording
    recorded: Recording

    @property
    def unpacked(self) -> Path:
        """The FMU unpacked to a folder, for importers that require one."""
        place = self.folder / "unpacked"
        if not place.exists():
            with zipfile.ZipFile(self.fmu) as archive:
                archive.extractall(place)
        return place

    def replay(self, ends: NDArray[np.float64], steps: NDArray[np.float64]) -> Recording:
        """Repeats the walk with an importer's communication points.

        Args:
            ends: of the steps, shape (steps,) [s].
            steps: sizes, shape (steps,) [s].
        """
        commands, outputs = read_csv(self.inputs), self.reference.names[1:]
        rows = []
        with Fmu(self.fmu) as plant:
            plant.initialise(0.0, float(commands.time[-1]))
            driven = plant.block(commands.names[1:])
            seen = [plant.block(plant.names("output", kind)) for kind in ("Real", "Boolean")]
            for begin, step, values in zip(
                [0.0, *ends[:-1]], steps, commands.data[:, 1:], strict=False
            ):
                driven.values[:] = values
                driven.set()
                plant.step(float(begin), float(step))
                for block in seen:
                    block.get()
                rows.append(np.concatenate([block.values for block in seen]))
        found = Recording(
            ("time", *(name for block in seen for name in block.names)),
            np.column_stack([ends, np.array(rows)]),
        )
        return Recording(("time", *outputs), found.columns(["time", *outputs]))


def record(folder: Path, *, duration: float, robot: str = "athena") -> ReferenceRun:
    """Simulates a compliant walk for `duration` [s] and writes FMU, commands and names of outputs
    to a folder.
    """
    folder.mkdir(parents=True, exist_ok=True)
    fmu = export_fmu(load_robot(robot), folder / f"{robot}.fmu")
    description = read_description(fmu)
    names = {
        kind: [one.name for one in description.modelVariables if one.causality == kind]
        for kind in ("input", "output")
    }
    scenario = load_scenario(
        "walk_flat",
        overrides=[
            f"robot={robot}",
            f"duration={duration}",
            f"macro_step={STEP}",
            "control=compliant",
        ],
    )
    recording = simulate(scenario, fmu=fmu).outcome.recording
    inputs, wanted = folder / "inputs.csv", folder / "outputs.txt"
    driven = [name for name in names["input"] if name in recording.names]
    commands = Recording(("time", *driven), recording.columns(["time", *driven]))
    write_csv(commands, inputs)
    wanted.write_text("\n".join(names["output"]), encoding="utf-8")
    recorded = Recording(
        ("time", *names["output"]), recording.columns(["time", *names["output"]])[1:]
    )
    reference = through_fmpy(fmu, commands, names["output"])
    return ReferenceRun(
        folder=folder, fmu=fmu, inputs=inputs, wanted=wanted, reference=reference, recorded=recorded
    )


def through_fmpy(fmu: Path, commands: Recording, outputs: list[str]) -> Recording:
    """Runs fmpy's simulate_fmu; commands and communication points are on the same grid, so that
    each command holds over its step.
    """
    signals = np.array(
        [tuple(row) for row in commands.data], dtype=[(name, np.float64) for name in commands.names]
    )
    end = float(commands.time[-1])
    found = fmpy.simulate_fmu(
        str(fmu),
        stop_time=end,
        output_interval=STEP,
        input=signals,
        output=outputs,
        fmi_type="CoSimulation",
    )
    return Recording(
        ("time", *outputs),
        np.column_stack([found[name].astype(np.float64) for name in ("time", *outputs)])[1:],
    )
