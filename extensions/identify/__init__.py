"""A robot's own logs: replays them on the plant FMU and finds the robot's numbers from them.

Imports `common` to `master`, `logs`, `export`, `results`, `report` and `run`.
"""
