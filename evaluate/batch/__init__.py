"""Many captures, each processed separately, on this machine or a cluster; one row has the outcome of each.

In: files, folders, patterns, names of the catalogue. Out: run folders, batch.json, batch.csv, the data set.
"""
