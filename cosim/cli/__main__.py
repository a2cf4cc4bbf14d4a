"""Runs the hexapod command without its script: `python -m hexapod_cosim.cosim.cli`."""

import sys

from hexapod_cosim.cosim.cli import main

sys.exit(main())
