"""The fit of a robot's numbers to its logs by output error.

problem.py: residuals of the readings and their derivatives, as functions of the numbers.
misfit.py: the noise of readings, and whether residuals are larger.
output_error.py: the search, and what the readings tell of its result.
workers.py: simulations in worker processes.
"""
