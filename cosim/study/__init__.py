"""Studies: many runs of scenarios that differ by factors, seeds and control, on this machine's
processes or on a cluster.

records, reading -> design (orders by number) -> job (what travels) -> worker (runs it), in a pool
or on a cluster -> store (what is kept); conduct is the loop around these, optimise the loop around
that; table, figures and report are what people read.
"""
