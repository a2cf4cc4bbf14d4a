"""Runs studies: many runs of scenarios that differ by factors, seeds and control.

The data flow, in the order of the modules:

    study file -> reading (rules, factors, checks) -> Study (records)
    Study -> runs: numbers every run and makes its Order
    Study -> job: what every worker needs -> folder: the manifest
    orders -> dispatch -> workers (an executor) -> worker -> Summary -> store (SQLite, a row a run)
    an optimisation asks Optuna for its orders: search
    store -> groups, search -> summary -> tables, figures, page; store -> folder: results.parquet
"""
