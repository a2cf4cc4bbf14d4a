"""Commands of a log: those that it lacks, and those that the servos cannot have got.

Imports `log`, `screening` and `start` beside it.
"""
