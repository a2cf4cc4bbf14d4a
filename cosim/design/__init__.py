"""Linearises the plant FMU and designs controller gains for it.

May import `common` to `export`.
"""
