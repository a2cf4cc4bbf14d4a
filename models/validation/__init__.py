"""Checks whether a robot is physically possible, by rules that need more than one number.

The annotations of the records check single values. A robot with impossible inertias would simulate
wrongly, so it is rejected on load.
"""

from hexapod_cosim.models.validation.bodies import check_robot, check_settings
from hexapod_cosim.models.validation.laws import check_contact_surface

__all__ = ["check_contact_surface", "check_robot", "check_settings"]
