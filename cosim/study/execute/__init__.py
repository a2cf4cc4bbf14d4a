"""Executes the runs of a study in worker processes or on a cluster. Imports `plan` and `store`."""
