"""Designs the gains of compliant control with python-control, before the walk.

Imports the rest of `controller`.
"""

from hexapod_cosim.controller.design.paper import StandingPlant
from hexapod_cosim.controller.design.plots import plot_design
from hexapod_cosim.controller.design.synthesis import design_gains
from hexapod_cosim.controller.gains_file import load_gains, save_gains

__all__ = ["StandingPlant", "design_gains", "load_gains", "plot_design", "save_gains"]
