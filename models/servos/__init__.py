"""Defines measured servos: motor.py the motor and the gear's friction (eq. 48-50), presets.py reads
their parameters from data/*.toml.
"""
