"""Linearises the plant FMU and designs controller gains for it.

Imports `common` to `export`.
"""
