"""Measures walks on height fields, blocks and soil, and MuJoCo on the same height field."""
