"""Defines contacts of feet, torso, knees and shanks with any ground and of legs with each other.

law.py has the state of a contact and the normal force, geometry.py points and speeds, bodies.py
contacts of others than feet, forces.py all contacts, switching.py touch-down and lift-off.
"""
