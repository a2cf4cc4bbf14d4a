"""What is run: scenarios read from TOML and checked. Imports `common` and `interface`."""
