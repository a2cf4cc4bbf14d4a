"""How the robot walks from a command alone: gait, foot paths, inverse kinematics and dynamics.

Imports `memory` and `plane`.
"""
