"""Builds the site of the documentation from docs/ (`make docs`)."""
