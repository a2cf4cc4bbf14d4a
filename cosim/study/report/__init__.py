"""Writes the report of a study with its figures. Imports `plan` and `store`."""
