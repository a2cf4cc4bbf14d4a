"""Corrects the planned joint commands by foot forces: slip PID, suspension, support, posture.

Imports `sense`, `walk`, `gains`, `memory`, `parts` and `plane`.
"""
