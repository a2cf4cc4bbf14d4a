"""Defines soft ground: law.py its forces (eq. 40-46), granular.py the resistance of granular media
as a function of direction, presets.py measured soils.
"""
