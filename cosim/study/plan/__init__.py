"""Plans a study: its file, factors, design points and identities of runs. Imports no other room
of `study`.
"""
