"""Writes FMUs, SSP packages and robot descriptions. Imports `common` to `master`."""
