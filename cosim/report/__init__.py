"""Writes the report of a run or of a comparison: one HTML file that works without a network.

Imports `common` to `results`.
"""
