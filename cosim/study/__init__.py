"""Runs studies: many runs of scenarios that differ by factors, seeds and control.

`plan` reads the study file and numbers the runs, `execute` runs them in worker processes or on a
cluster, `store` keeps the results, and `report` shows them.
"""
