"""Runs the plant FMU with other tools (importers) and compares their results with fmpy's."""
