"""Writes FMUs, SSP packages and robot descriptions for other tools. Imports `common` to
`master`.
"""
