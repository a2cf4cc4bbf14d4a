"""Keeps the runs of a study on disk and reads results from them. Imports `plan`."""
