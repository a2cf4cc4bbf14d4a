"""What this extension adds to the command line."""

from hexapod_cosim.cosim.cli.extension import Command, Extension

MODULE = "hexapod_cosim.extensions.course.command"
BENCHMARK = Command(
    name="benchmark",
    about="Judge controls on the course of fixed cases.",
    place=f"{MODULE}:benchmark",
)
EXTENSION = Extension(commands=[BENCHMARK], reports={"benchmark": f"{MODULE}:report_on"})
