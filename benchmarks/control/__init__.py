"""Compares compliant with kinematic control, part by part: `python -m benchmarks.control`."""
