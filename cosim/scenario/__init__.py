"""Scenarios: what is run, read from TOML files and checked.

May import `common` and `interface`.
"""
