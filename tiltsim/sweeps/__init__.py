"""Sweeps: many flights of one scenario along axes, into one Parquet dataset.

`tables` mirrors the file, `plan` makes scenarios of it, `flying` flies a chunk of them, `folder`
keeps what is finished, `running` hands chunks to processes or to a cluster.
"""
