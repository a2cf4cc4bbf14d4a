"""Scenarios: what is run, read from TOML files and checked.

Imports `common` and `interface`.
"""
