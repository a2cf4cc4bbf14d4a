"""Computes contacts of the torso, the knees and the shanks with the ground, and distances of legs."""
