"""Validates FMUs: fmpy's checks and a trial of the binary. Imports `common` to `master`."""
