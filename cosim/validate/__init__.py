"""Checks FMU archives against the FMI standard. Imports `common` to `export`."""
