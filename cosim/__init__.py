"""Runs the plant FMU and the controller in one co-simulation, measures and reports its results.

Imports `models` and `controller`; its folders import each other as docs/architecture.md shows.
"""
