"""Gymnasium environments of the walking hexapod, one by one and as vectors whose loop is in C.

Importing this package registers `Hexapod-v0`, `HexapodRough-v0`, `HexapodSoil-v0` and
`HexapodPush-v0` with Gymnasium. It imports models, controller and cosim.
"""

from __future__ import annotations

from importlib.util import find_spec

from hexapod_cosim.cosim.common.installation import install_extra

if find_spec("gymnasium") is None:
    raise ModuleNotFoundError(
        f"the extension gym needs gymnasium, which is not installed; {install_extra('gym')}",
        name="gymnasium",
    )

from hexapod_cosim.extensions.gym.registration import register_all

register_all()
