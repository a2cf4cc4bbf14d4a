"""Controls that users name: built-in ones, classes of Python files, and controller FMUs.

Reads the text of a control, loads the user's class or FMU, and connects it to the plant. Imports
`common`, `interface`, `scenario` and `master`.
"""

from hexapod_cosim.cosim.control.controllers import make_controller
from hexapod_cosim.cosim.scenario.controls import Control, parse_control

__all__ = ["Control", "make_controller", "parse_control"]
