"""Files and the locations of the installed FMUs. Imports no other room."""
