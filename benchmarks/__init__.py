"""Benchmarks of the plant and of other engines (peers): `python -m benchmarks.run`.

benchmarks/README.md says what may be compared, and why.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build" / "bench"

# the ctypes structures of hexapod.h are among the tests, which compare them with the compiler's
# layout
sys.path.append(str(ROOT / "tests" / "support"))
