"""The fit of a robot's numbers to its logs by output error.

least_squares.py: bounded least squares with Huber's loss, and derivatives by differences.
problem.py: residuals of the readings and their derivatives, as functions of the numbers.
search.py: the search. judging.py: what the readings say of its result.
misfit.py, covariance.py: noise of readings, which numbers are determined, and intervals.
"""
