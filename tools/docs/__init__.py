"""The documentation's site, built from docs/ by `make docs`."""
