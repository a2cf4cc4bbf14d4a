"""Together: the plant FMU and the controller in one co-simulation, and what is measured on it."""
