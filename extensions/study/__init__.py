"""Runs studies: many runs of scenarios that differ by factors, seeds and control.

The data flow, in the order of the modules:

    study file -> reading (rules, factors, checks) -> Study (records)
    Study -> orders: numbers every run and makes its Order
    Study -> job: what every worker needs -> folder: the manifest
    orders -> dispatch (an executor) -> worker -> Summary -> store (SQLite, a row a run)
    an optimisation asks for its orders trial by trial: search
    store -> summary -> figures, page; store -> folder: results.parquet
"""
