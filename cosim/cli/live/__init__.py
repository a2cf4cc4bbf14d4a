"""The commands of the live robot: `hexapod live` and `hexapod realtime`."""
