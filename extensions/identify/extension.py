"""What this extension adds to the command line."""

from hexapod_cosim.cosim.cli.extension import Command, Extension

PACKAGE = "hexapod_cosim.extensions.identify"
REPLAY = Command(
    name="replay",
    about="Drive the plant with a recorded log and compare all readings.",
    place=f"{PACKAGE}.replay:replay_command",
)
IDENTIFY = Command(
    name="identify",
    about="Find a robot's numbers from its own logs.",
    place=f"{PACKAGE}.command:identify",
)
EXTENSION = Extension(commands=[REPLAY, IDENTIFY])
