"""Computes contacts of torso, knees and shanks with the ground, and distances between legs."""
