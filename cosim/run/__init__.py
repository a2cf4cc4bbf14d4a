"""Runs scenarios, one or many, in this process or in worker processes. Imports all rooms above
but `validate` and `report`.
"""
