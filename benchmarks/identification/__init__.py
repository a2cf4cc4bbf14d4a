"""Robots with secret numbers, identified from their logs."""
