"""Registers `Hexapod-v0`, `HexapodRough-v0`, `HexapodSoil-v0` and `HexapodPush-v0` with Gymnasium.

Importing this module does it; a module of its own, because the command line imports no Gymnasium.
"""

from __future__ import annotations

from hexapod_cosim.cosim.common.installation import install_extra
from hexapod_cosim.extensions.gym.settings import TASKS

try:
    import gymnasium
except ImportError as error:
    text = f"{__name__} needs gymnasium, which is not installed; {install_extra('gym')}"
    raise ModuleNotFoundError(text, name="gymnasium") from error

for name in TASKS:
    if name not in gymnasium.registry:
        gymnasium.register(
            id=name,
            entry_point="hexapod_cosim.extensions.gym.environment:HexapodEnv",
            vector_entry_point="hexapod_cosim.extensions.gym.vector:HexapodVectorEnv",
            kwargs={"task": name},
        )
