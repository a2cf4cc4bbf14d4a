"""Surfaces of uneven ground: their data, their geometry, their files and a catalogue of them."""
