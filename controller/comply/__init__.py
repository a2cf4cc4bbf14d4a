"""Corrects the planned joint commands by foot forces: support, squeeze, paper.

Imports `sense`, `walk`, `gains`, `memory` and `plane`.
"""
