"""The rigid-body part of a robot's numbers, by linear least squares on the inverse dynamics.

regressor.py: the equations of motion as linear functions of masses, first moments and inertias.
base_parameters.py: which combinations of these a log tells, and possible bodies nearest to them.
samples.py: motion, torques and foot forces of a log, filtered and differentiated.
linear_start.py: the start of the output error.
"""
