"""Results of runs: metrics, warnings, recordings, comparisons and result folders.

Imports `common` to `master` and `logs`.
"""
