"""`python -m hexapod_cosim.cosim.cli`: the hexapod command without its script."""

import sys

from hexapod_cosim.cosim.cli import main

sys.exit(main())
