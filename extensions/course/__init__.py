"""The course: fixed cases that judge controls, their statistics, picture and report.

Imports `common`, `interface`, `scenario`, `master`, `export`, `results`, `report`, `design` and
`run`.
"""
