"""The command `hexapod study`."""
