"""Runs a scenario under several controls, over several seeds, for `hexapod compare`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.cli.failures import FELL, SUCCESS
from hexapod_cosim.cosim.cli.runs import (
    RunOptions,
    Words,
    check_accuracy,
    chosen_controls,
    default_folder,
    run_all,
    run_into,
    show_rows,
    titled,
)
from hexapod_cosim.cosim.cli.terminal import show_files, show_json, show_text, waiting, warn
from hexapod_cosim.cosim.common.files import write_json
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.report.figures import draw_figures
from hexapod_cosim.cosim.report.tables import about, about_accuracy, comparison_rows, with_errors
from hexapod_cosim.cosim.report.writing import write_report
from hexapod_cosim.cosim.results.accuracy import Accuracy
from hexapod_cosim.cosim.results.facts import Result, gait_differences
from hexapod_cosim.cosim.results.folder import (
    ACCURACY,
    METRICS_FILE,
    ResultsFolder,
    read_scenario,
    results_folder,
    stored_result,
)
from hexapod_cosim.cosim.results.metric_table import has_net_slip
from hexapod_cosim.cosim.results.side_by_side import (
    SEEDS,
    Comparisons,
    compare_all,
    write_comparison,
    write_seeds,
)
from hexapod_cosim.cosim.results.summary import summarise
from hexapod_cosim.cosim.run.gait_selection import select_gait
from hexapod_cosim.cosim.run.plan import chosen_gains
from hexapod_cosim.cosim.run.plant import PlantFmus
from hexapod_cosim.cosim.scenario.controls import CHOOSER, Control
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import CHOSEN, COMPARED, CONTROLS, OWN, Scenario
from hexapod_cosim.cosim.scenario.variation import STANDARD
from hexapod_cosim.models import ScenarioError

MAX_SEEDS = 10_000
CHOSEN_WALK = (f"{CONTROLS[0]}@{CHOSEN}", f"{CHOOSER}@{CHOSEN}")


def compare(
    name: str, words: Words, options: RunOptions, *, output: Path | None, as_json: bool
) -> int:
    """Runs the comparison of a scenario and prints the results; returns the exit code.

    words: of the command line. Raises HexapodError.
    """
    work = _work(name, words, options)
    work.check()
    done = run_work(work, output or default_folder(name))
    report = None if done.report is None else str(done.report)
    if as_json:
        show_json({**_table(done.comparison, done.checked), "report": report})
    else:
        _show(done, work.walks)
        show_text("\n".join(filter(None, (about(done.comparison), report and f"report: {report}"))))
    return FELL if done.comparison.losses else SUCCESS


def _work(name: str, words: Words, options: RunOptions) -> Work:
    """Returns the comparison of a scenario."""
    seeds = words.seeds or 0
    plan = _plan(name, words.settings, seeds)
    alike = words.controls or words.gains or plan.names_walk
    controls = _controls(words.controls or CONTROLS, plan)
    chosen = () if alike else chosen_controls(CHOSEN_WALK, plan)
    command = words.command("compare", name)
    return Work(plan, controls, chosen, seeds, command, options, words.accuracy)


@dataclass(frozen=True)
class Work:
    """A comparison to run: its scenario, controls, number of seeds and options."""

    plan: Scenario
    controls: tuple[Control, ...]  # whose first seed is recorded and drawn
    chosen: tuple[Control, ...]  # of CHOSEN_WALK: what gait and stance give, in the tables alone
    seeds: int
    command: str
    options: RunOptions
    accuracy: bool

    def check(self) -> None:
        """Designs the gains of all runs, or raises errors before anything is run."""
        for control in self.compared:
            chosen_gains(replace(self.plan, control=control.text), self.options.gains)

    def with_fmu(self, folder: Path) -> Work:
        """Returns this work with a plant FMU for all its runs, exported to a folder.

        A given FMU stays. Raises HexapodError when none can be exported.
        """
        fmu = PlantFmus(folder, given=self.options.fmu).fmu(self.plan.robot)
        return replace(self, options=replace(self.options, fmu=fmu))

    @property
    def compared(self) -> tuple[Control, ...]:
        """All controls of the tables."""
        return (*self.controls, *self.chosen)

    @property
    def labels(self) -> list[str]:
        """The labels of the controls that are recorded."""
        return [control.label for control in self.controls]

    @property
    def walks(self) -> list[str]:
        """A sentence for each control, if they walk differently."""
        found = {}
        for control in self.compared:
            plan = replace(self.plan, control=control.text)
            walk = select_gait(plan, gains=chosen_gains(plan, self.options.gains))
            found[control.label] = walk.as_facts()
        return gait_differences(found)


@dataclass(frozen=True)
class Done:
    """A comparison that was run, with its report."""

    results: Mapping[str, Result]
    comparison: Comparisons
    checked: Mapping[str, Accuracy]
    files: list[Path]
    report: Path | None  # None: outputs.plots is false


def run_work(work: Work, path: Path) -> Done:
    """Runs a comparison into a folder and reports it. Raises HexapodError.

    The figures are drawn in a thread while worker processes run the other seeds. Nothing is drawn
    or reported where outputs.plots is false.
    """
    with results_folder(path, work.labels) as folder, TemporaryFolder("compare") as place:
        work = work.with_fmu(place)
        results, files = _first_seed(work, folder)
        stored = {control: stored_result(result) for control, result in results.items()}
        views = {control: run.view for control, run in stored.items()}
        with ThreadPoolExecutor(1) as thread:
            figures = thread.submit(draw_figures, views) if work.plan.outputs.plots else None
            comparison = _all_seeds(work, results, folder.path)
            files += [folder.path / SEEDS]
            files += write_comparison(
                folder.path,
                work.plan,
                comparison,
                labels=work.labels,
                command=work.command,
                walks=work.walks,
            )
            checked = _accuracies(work, comparison) if work.accuracy else {}
            if checked:
                write_json(folder.path / METRICS_FILE, _table(comparison, checked))
            if figures is None:
                return Done(results, comparison, checked, files, None)
            with waiting("drawing figures and report"):
                files += write_report(
                    stored,
                    folder.path,
                    warn=warn,
                    comparison=comparison,
                    scenario=read_scenario(folder.path),
                    command=work.command,
                    walks=work.walks,
                    accuracies=checked,
                    figures=figures.result(),
                )
    return Done(results, comparison, checked, files, files[-1])


def _show(done: Done, walks: Sequence[str]) -> None:
    """Prints the metrics of all controls, their accuracy if it was checked, walks and files."""
    comparison, checked = done.comparison, done.checked
    net_slip = has_net_slip(next(iter(done.results.values())).parameters)
    rows = comparison_rows(comparison, net_slip=net_slip)
    compared = [pair.title for pair in comparison.pairs]
    show_rows(with_errors(rows, checked), comparison.labels, compared)
    if checked:
        show_text(about_accuracy(checked))
    for text in walks:
        show_text(text)
    show_files(done.files)


def _plan(scenario: str, settings: Sequence[str], seeds: int) -> Scenario:
    """Reads the scenario; several seeds get the standard variation unless it gives its own."""
    if not 1 <= seeds <= MAX_SEEDS:
        raise ScenarioError(
            "not a number of runs",
            got=seeds,
            expected=f"1 to {MAX_SEEDS}",
            fix="write --seeds 10",
            where="--seeds",
        )
    plan = titled(load_scenario(scenario, overrides=settings), settings)
    return replace(plan, variation=STANDARD) if seeds > 1 and plan.variation is None else plan


def _controls(texts: Sequence[str], plan: Scenario) -> tuple[Control, ...]:
    """Returns the controls to compare, all in one walk unless they are named with another one.

    Raises HexapodError for fewer than two.
    """
    controls = chosen_controls(texts, plan)
    if len(controls) < 2:
        other = next(name for name in COMPARED if name != controls[0].label)
        raise ScenarioError(
            "nothing to compare with",
            got=controls[0].label,
            expected="two or more controls, the reference first",
            fix=f"write --control {other} --control {texts[0]}, or use simulate",
            where="--control",
        )
    return controls if plan.names_walk else tuple(one.walking(OWN) for one in controls)


def _first_seed(work: Work, folder: ResultsFolder) -> tuple[dict[str, Result], list[Path]]:
    """Runs the first seed under all controls and keeps the recordings."""
    results: dict[str, Result] = {}
    files: list[Path] = []
    for control in work.controls:
        with results_folder(folder.path / control.label) as part:
            walk = replace(work.plan, control=control.text)
            results[control.label], files_of_run = run_into(
                walk, [folder, part], work.command, work.options
            )
        files += files_of_run
    return results, files


def _all_seeds(work: Work, results: Mapping[str, Result], folder: Path) -> Comparisons:
    """Runs the other seeds and compares all runs."""
    plan = work.plan
    scenarios = [
        replace(plan, control=control.text, seed=seed)
        for seed in range(plan.seed, plan.seed + work.seeds)
        for control in (work.compared if seed > plan.seed else work.chosen)
    ]
    first = [summarise(results[label]) for label in work.labels]
    done = run_all("seeds", scenarios, work.options, first)
    write_seeds(folder / SEEDS, done)
    of_controls = {
        one.label: [run for run in done if run.control == one.label] for one in work.compared
    }
    comparison = compare_all(of_controls)
    for text in comparison.warnings if work.seeds > 1 else comparison.losses:
        warn(text)
    return comparison


def _accuracies(work: Work, comparison: Comparisons) -> dict[str, Accuracy]:
    """Returns the accuracies, by control, of the means over the compared seeds."""
    found = {}
    for control in work.compared:
        runs = comparison.judged[control.label]
        plans = [replace(work.plan, control=control.text, seed=run.seed) for run in runs]
        found[control.label] = check_accuracy(plans, runs, work.options)
    return found


def _table(comparison: Comparisons, checked: Mapping[str, Accuracy]) -> dict[str, Any]:
    """Returns the content of metrics.json."""
    table = comparison.as_table()
    if checked:
        table[ACCURACY] = {control: item.as_table() for control, item in checked.items()}
    return table
