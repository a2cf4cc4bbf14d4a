"""Defines the commands `hexapod gym train` and `hexapod gym export`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.cosim.cli.options import Json
from hexapod_cosim.cosim.cli.terminal import show_files, show_json, warn
from hexapod_cosim.cosim.common.files import atomic_path
from hexapod_cosim.cosim.export.plant import export_interface
from hexapod_cosim.extensions.gym.policy import load_policy, load_policy_interface
from hexapod_cosim.extensions.gym.settings import task
from hexapod_cosim.extensions.gym.train import Progress, TrainSettings, train, training_settings
from hexapod_cosim.models import load_robot

SHOWN_EVERY = 5  # generations
Output = Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="File to write.")]
RobotName = Annotated[str, typer.Option("--robot", help="Name or file of the robot.")]

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    help="Train and export policies for reinforcement learning.",
)


@app.command("train")
def train_policy(
    output: Output,
    env: Annotated[
        str, typer.Option("--env", help="One of `hexapod list environments`.")
    ] = "Hexapod-v0",
    robot: RobotName = "athena",
    minutes: Annotated[float, typer.Option("--minutes", help="Duration.")] = 8.0,
    generations: Annotated[int, typer.Option("--generations", help="At most.")] = 100_000,
    seed: Annotated[int, typer.Option("--seed", help="Of the random numbers.")] = 0,
    json: Json = False,
) -> None:
    """Train a policy into an .npz file; Ctrl-C ends it early with what is learnt."""
    how = TrainSettings(minutes=minutes, generations=generations, seed=seed)
    settings = replace(training_settings(task(env)), robot=robot)
    with atomic_path(output) as part:  # refuses a bad place before the training
        policy, rising = train(settings, how, (lambda _: None) if json else _show)
        policy.save(part)
    if rising:
        warn("too little training: the returns were still rising; give more --minutes")
    _show_written(output, json=json)


@app.command("export")
def export(
    policy: Annotated[Path, typer.Argument(metavar="POLICY", help="The .npz file of train.")],
    output: Output,
    robot: RobotName = "athena",
    fmi: Annotated[int, typer.Option("--fmi", min=2, max=3, help="Version of FMI.")] = 2,
    json: Json = False,
) -> None:
    """Write a policy as a controller FMU."""
    interface = load_policy_interface(load_policy(policy), load_robot(robot))
    _show_written(export_interface(interface, output, fmi=fmi), json=json)


def _show_written(path: Path, *, json: bool) -> None:
    """Prints which file was written."""
    if json:
        show_json({"files": [str(path)]})
    else:
        show_files([path])


def _show(progress: Progress) -> None:
    """Prints every fifth generation."""
    if progress.generation % SHOWN_EVERY == 0:
        print(
            f"generation {progress.generation:4d}  return {progress.mean:7.2f}  "
            f"best {progress.best:7.2f}  way {progress.distance:5.2f} m  {progress.seconds:4.0f} s",
            flush=True,
        )
