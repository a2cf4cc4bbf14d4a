"""What this extension adds to the command line."""

from hexapod_cosim.cosim.cli.extension import Command, Extension

GYM = Command(
    name="gym",
    about="Train and export policies for reinforcement learning.",
    place="hexapod_cosim.extensions.gym.command:app",
)
EXTENSION = Extension(
    commands=[GYM],
    lists={"environments": "hexapod_cosim.extensions.gym.settings:environment_rows"},
    interfaces=["hexapod_cosim.extensions.gym.policy:default_interface"],
)
