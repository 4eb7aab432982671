"""A data set of motions: an index, the motions in Parquet shards, splits by person, and checksums.

In: motions and the rows about their captures. Out: files that pandas, polars, DuckDB and Hugging Face's
datasets read.
"""
