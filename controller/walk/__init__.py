"""Plans the walk from the command: gait, foot paths, inverse kinematics and dynamics, slow loops.

Imports `gains`, `memory` and `plane`.
"""
