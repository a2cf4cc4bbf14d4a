"""The fit of a robot's numbers to its logs by output error.

least_squares.py: bounded least squares with Huber's loss.
problem.py: residuals of the readings and their derivatives, as functions of the numbers.
search.py: the search. judging.py: what the readings say of its result.
misfit.py, covariance.py, rank.py: noise of readings, intervals, and which numbers are determined.
workers.py: simulations in worker processes.
"""
