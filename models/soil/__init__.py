"""Defines soft ground: law.py its forces (eq. 40-46), losses.py its powers, presets.py the measured
soils of data/*.toml.
"""
