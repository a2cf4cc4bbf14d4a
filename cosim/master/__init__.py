"""The co-simulation master: FMUs, signals, sensors and the loop, in Python and in C.

May import `common`, `interface` and `scenario`.
"""
