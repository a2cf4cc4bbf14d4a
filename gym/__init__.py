"""Gymnasium environments of the walking hexapod, one by one and as vectors whose loop is in C.

Importing this package registers `Hexapod-v0`, `HexapodRough-v0`, `HexapodSoil-v0` and
`HexapodPush-v0` with Gymnasium. It imports models, controller and cosim.
"""

from __future__ import annotations

from hexapod_cosim.gym.registration import register_all

register_all()
