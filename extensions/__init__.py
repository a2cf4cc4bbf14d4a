"""Extensions: each folder uses documented modules of the core, adds its own commands, and can be
deleted. The core imports none of them; it finds them by the entry-point group hexapod.commands.
"""
