"""What `hexapod study` does and shows; apart from the command itself, since what this imports
takes a second.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from hexapod_cosim.cosim.cli.failures import FELL, SUCCESS
from hexapod_cosim.cosim.cli.terminal import (
    counting_bar,
    show_files,
    show_json,
    show_table,
    show_text,
    warn,
)
from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.results.comparison import METHOD
from hexapod_cosim.cosim.study.execute.conduct import Tell
from hexapod_cosim.cosim.study.execute.study import Begun, Options, run_study
from hexapod_cosim.cosim.study.plan.reading import load_study
from hexapod_cosim.cosim.study.report.notes import NO_WALK, notes
from hexapod_cosim.cosim.study.report.report import (
    optimum_changes,
    optimum_rows,
    overall_rows,
    write_study_report,
)
from hexapod_cosim.cosim.study.store.manifest import TIMES
from hexapod_cosim.cosim.study.store.results import Results, read_results, summary_of

MOST_REASONS = 10


def carry_out(file: str, folder: Path, options: Options, *, json: bool) -> int:
    """Runs a study, or what is missing of it, writes its report and shows what came out. Returns
    the exit code.
    """
    plan = load_study(file)
    try:
        with progress(plain=not json) as begun:
            results = run_study(plan, folder, options=options, begun=begun)
    except KeyboardInterrupt:
        warn(f"stopped; what was run is in {folder}, and the same command goes on from there")
        raise
    found, files = report_on(folder)
    warn_of(found)
    if json:
        show_json({**summary_of(found), "results": str(results), "report": str(files[-1])})
    else:
        show_study(found)
        show_files([results, folder / TIMES, *files])
        print(f"report: {files[-1]}")
    return FELL if _only_falls(found) else SUCCESS


def _only_falls(found: Results) -> bool:
    """Whether no run at all walked to its end, and the robot fell in some of them."""
    overall = found.overall
    return not any(overall.walked.values()) and any(
        status == COMPLETED for _, status, _ in overall.failures
    )


def warn_of(found: Results) -> None:
    """What to know before reading the figures, as the report says it; where nothing walked, what
    ended the runs instead.
    """
    for text in (*hopeless(found), *(note for note in notes(found) if note != NO_WALK)):
        warn(text)


def hopeless(found: Results) -> list[str]:
    """Controls under which no run at all walked to its end, and why."""
    texts = []
    for control, total in found.overall.total.items():
        if total and not found.overall.walked.get(control, 0):
            reasons = [
                (count, *key[1:])
                for key, count in found.overall.failures.items()
                if key[0] == control
            ]
            count, status, reason = reasons[0]
            alike = "all" if len(reasons) == 1 else f"{count} of them"
            texts.append(
                f"none of {total} {control} runs walked to its end; {alike} {_ending(status)}: {reason}"
            )
    return texts


def _ending(status: str) -> str:
    """How a run that did not walk to its end came to it."""
    return "fell" if status == COMPLETED else status


def report_on(folder: Path) -> tuple[Results, list[Path]]:
    """Reads a study's folder and writes its tables and report."""
    found = read_results(folder)
    return found, write_study_report(found, folder)


@contextmanager
def progress(*, plain: bool) -> Iterator[Begun]:
    """A bar with rate, estimate and failures on a terminal, `plain` lines elsewhere, from when
    it is known how many runs there are.
    """
    with ExitStack() as shown:

        def begun(total: int, done: int) -> Tell:
            if done:
                print(f"goes on: {done} of {total} runs are there already", file=sys.stderr)
            show = shown.enter_context(counting_bar("runs", total, plain=plain))
            show(done, 0)
            count, failed = done, 0

            def tell(more: int, lost: int) -> None:
                nonlocal count, failed
                count, failed = count + more, failed + lost
                show(count, failed)

            return tell

        yield begun


def show_study(found: Results) -> None:
    """Totals, the table of all runs, the optimum, failures by reason."""
    overall, controls = found.overall, found.study.run_controls
    rows = overall_rows(found)
    columns = [
        "metric",
        "unit",
        *controls,
        *(["change", "95 % interval", ""] if len(controls) == 2 else []),
    ]
    texts = [
        [
            row["name"],
            row["unit"],
            *row["values"],
            *([row["change"], row["interval"], row["verdict"]] if len(controls) == 2 else []),
        ]
        for row in rows
    ]
    show_table(
        columns,
        texts,
        right=[k for k, name in enumerate(columns) if name not in ("metric", "unit", "")],
    )
    walked = ", ".join(
        f"{control} {overall.walked.get(control, 0)} of {overall.total.get(control, 0)}"
        for control in controls
    )
    show_text(f"{overall.runs} runs at {found.of_points} points; walked to the end: {walked}")
    if len(controls) == 2:
        show_text(f"{METHOD}.")
    for (control, status, reason), count in list(overall.failures.items())[:MOST_REASONS]:
        show_text(f"{count:6d} x {control} {_ending(status)}: {reason}")
    for row in optimum_rows(found):
        settings = ", ".join(
            f"{name} {text}"
            for name, text in zip((found.optimum or {})["variables"], row["settings"], strict=True)
        )
        show_text(
            f"{row['label']}: {settings}; training {' '.join(row['training'])}, held out {' '.join(row['held_out'])}"
        )
    show_gained(found)


def show_gained(found: Results) -> None:
    """What the best trials change of what the optimiser began from."""
    for row in optimum_changes(found):
        interval = f" (95 % interval {row['interval']})" if row["interval"] else ""
        verdict = f", {row['verdict']}" if row["verdict"] else ""
        show_text(
            f"{row['label']}, {row['part']}: {row['metric']} {row['change']}{interval}, {row['pairs']} pairs{verdict}"
        )
