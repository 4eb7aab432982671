"""Reading files that nobody vouches for: bounded, strict, and checked against types and schema versions.

In: paths, and values of TOML, JSON and Parquet. Out: checked values, or an error of one line that names the
file and the key.
"""
