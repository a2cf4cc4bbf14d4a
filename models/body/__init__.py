"""Computes contacts of torso, knees and shanks with the ground, and of legs with each other."""
