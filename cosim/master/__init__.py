"""The co-simulation master: FMUs, signals, sensors and the loop, in Python and in C.

Imports `common`, `interface` and `scenario`.
"""
