"""Design of the compliant control with python-control: offline, before the walk."""

from hexapod_cosim.controller.design.plots import plot_design
from hexapod_cosim.controller.design.synthesis import design_gains, normal_loops, tangential_loops
from hexapod_cosim.controller.gains import load_gains, save_gains

__all__ = ["design_gains", "load_gains", "normal_loops", "plot_design", "save_gains", "tangential_loops"]
