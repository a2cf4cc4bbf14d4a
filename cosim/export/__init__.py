"""Writes the FMUs of robots and checks FMUs. Imports `common` to `master`."""
