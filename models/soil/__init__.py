"""Defines soft ground: law.py its forces and powers (eq. 40-46), presets.py the measured
soils of data/*.toml.
"""
