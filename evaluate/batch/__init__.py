"""Many captures: each by itself, on this machine or a cluster, with a row for what became of it.

In: files, folders, patterns, names of the catalogue. Out: run folders, batch.json, batch.csv, the data set.
"""
