"""Benchmarks of the plant and of its peers; `python -m benchmarks.run`. What may be compared,
and why: README.md here.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "build" / "bench"

# hexapod.h's structures in ctypes stand once, beside the tests that compare them with the
# compiler's layout
sys.path.append(str(ROOT / "tests" / "support"))
