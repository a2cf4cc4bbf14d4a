"""What a run leaves: metrics, warnings, recordings, comparisons and result folders. Imports
`common` to `master`.
"""
