"""Files, messages and the places of the installed plant. Imports no other room."""
