"""Drives a robot live: plant and controller in real time in a process of their own, and a server
for pages in a browser.

Imports `common` to `run` and `report`.
"""
