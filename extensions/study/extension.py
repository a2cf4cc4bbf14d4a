"""What this extension adds to the command line."""

from hexapod_cosim.cosim.cli.extension import Command, Extension

MODULE = "hexapod_cosim.extensions.study.study_command"
STUDY = Command(
    name="study",
    about="Run a study: a sweep, a Monte Carlo study or an optimisation.",
    place=f"{MODULE}:study",
)
EXTENSION = Extension(
    commands=[STUDY],
    reports={"study": f"{MODULE}:report_again"},
    lists={"studies": "hexapod_cosim.extensions.study.bundled:bundled_studies"},
)
