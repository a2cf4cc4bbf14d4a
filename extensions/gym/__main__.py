"""The command `python -m hexapod_cosim.extensions.gym`: lists, measures, trains, exports."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from hexapod_cosim.cosim.common.files import atomic_path
from hexapod_cosim.extensions.gym.bench import bench
from hexapod_cosim.extensions.gym.export import export_policy
from hexapod_cosim.extensions.gym.policy import load_policy
from hexapod_cosim.extensions.gym.tasks import TASKS, TITLES, task
from hexapod_cosim.extensions.gym.train import Progress, TrainSettings, train, training_settings
from hexapod_cosim.models import HexapodError, load_robot

USAGE_ERROR = 2
DEFAULT = "Hexapod-v0"
SHOWN_EVERY = 5  # generations


def parser() -> argparse.ArgumentParser:
    """Returns the parser of the command line."""
    main_parser = argparse.ArgumentParser(
        prog="python -m hexapod_cosim.extensions.gym",
        description="Gymnasium environments of the walking hexapod.",
        epilog="extensions/gym/README.md leads from the installation to a trained policy.",
    )
    commands = main_parser.add_subparsers(dest="command", required=True)
    commands.add_parser("list", help="names the environments")
    measured = commands.add_parser("bench", help="measures environment steps per second")
    measured.add_argument("--envs", type=int, default=64, help="robots in the vector (64)")
    measured.add_argument("--seconds", type=float, default=10.0, help="of robot time (10)")
    trained = commands.add_parser("train", help="trains a policy; Ctrl-C ends it early")
    trained.add_argument("-o", "--output", type=Path, required=True, help="the policy's .npz file")
    trained.add_argument("--env", default=DEFAULT, help=f"environment ({DEFAULT})")
    trained.add_argument("--robot", default="athena", help="name or file of the robot (athena)")
    trained.add_argument("--minutes", type=float, default=8.0, help="of training (8)")
    trained.add_argument("--generations", type=int, default=100_000, help="at most")
    trained.add_argument("--seed", type=int, default=0, help="of the random numbers (0)")
    exported = commands.add_parser("export", help="writes a policy as a controller FMU")
    exported.add_argument("policy", type=Path, help="the .npz file of train")
    exported.add_argument("-o", "--output", type=Path, required=True, help="the FMU")
    exported.add_argument("--robot", default="athena", help="name or file of the robot (athena)")
    exported.add_argument("--fmi", type=int, choices=(2, 3), default=2, help="version (2)")
    return main_parser


def list_environments() -> None:
    """Prints the environments and what distinguishes them."""
    for name in TASKS:
        print(f"{name:18} {TITLES[name]}")


def show(progress: Progress) -> None:
    """Prints every fifth generation."""
    if progress.generation % SHOWN_EVERY == 0:
        print(
            f"generation {progress.generation:4d}  return {progress.mean:7.2f}  "
            f"best {progress.best:7.2f}  way {progress.distance:5.2f} m  {progress.seconds:4.0f} s",
            flush=True,
        )


def run(given: argparse.Namespace) -> None:
    """Runs a command. Raises HexapodError."""
    if given.command == "list":
        list_environments()
    elif given.command == "bench":
        print(bench(count=given.envs, duration=given.seconds))
    elif given.command == "train":
        how = TrainSettings(minutes=given.minutes, generations=given.generations, seed=given.seed)
        settings = replace(training_settings(task(given.env)), robot=given.robot)
        with atomic_path(given.output) as part:  # refuses a bad place before the training
            train(settings, how, show).save(part)
        print(f"wrote {given.output}")
    else:
        policy = load_policy(given.policy)
        path = export_policy(policy, load_robot(given.robot), given.output, fmi=given.fmi)
        print(f"wrote {path}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line and returns the exit code: 0, or 2 for an error that is named."""
    try:
        run(parser().parse_args(arguments))
    except HexapodError as error:
        print(f"error: {error}", file=sys.stderr)
        return USAGE_ERROR
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
