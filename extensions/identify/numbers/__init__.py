"""Unknown numbers of a robot file: how each is read, written and limited.

Imports `models` alone.
"""
