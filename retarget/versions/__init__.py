"""Versioned data sets: built from raw recordings, locked, checked, and compared as motions.

In: `params.toml` and raw recordings. Out: canonical arrays of every stage, a manifest of their hashes, and
the differences between two data sets in degrees and millimetres.
"""
