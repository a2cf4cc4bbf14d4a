"""Runs scenarios, one or many, in this process or in worker processes.

Imports every folder of `cosim` above it but `validate` and `report`.
"""

from hexapod_cosim.cosim.run.single_run import simulate

__all__ = ["simulate"]
