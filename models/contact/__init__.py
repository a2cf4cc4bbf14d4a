"""Contacts of feet, torso, knees and shanks with any ground: forces and switching."""
