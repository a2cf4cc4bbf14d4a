"""Derives contacts, touch-downs, trust in the plan and the carried weight from foot forces.

Imports `memory` and `plane`.
"""
