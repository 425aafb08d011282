"""Sweeps: many flights of one scenario along axes, into one Parquet dataset.

`tables` mirrors the sweep file, `loading` reads it, `points` makes scenarios of it, `chunks` flies
some of them into rows, `running` distributes chunks over processes or a cluster, `dataset` saves
them in the folder of the sweep and reads the results.
"""
