"""Results of runs: metrics, warnings, recordings, comparisons and result folders.

May import `common` to `master`.
"""
