"""Logs of robots as MCAP files with the messages of ROS 2.

Writes a recording as such a file and reads the files of robots. Imports `common` to `master`.
"""
