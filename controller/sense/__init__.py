"""Derives contacts, touch-downs, landings and the carried weight from measured foot forces.

Imports `memory` and `plane`.
"""
