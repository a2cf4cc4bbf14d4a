"""Defines contacts of feet, torso, knees and shanks with any ground and of legs with each other.

law.py has the normal force, geometry.py points and speeds, forces.py the contacts and their states,
switching.py touch-down and lift-off.
"""
