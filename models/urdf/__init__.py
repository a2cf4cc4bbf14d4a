"""URDF in both directions: table.py reads one as the tables of a robot file, writer.py writes a
robot as one.
"""
