"""The catalogue of public recordings: list, fetch, verify and add recordings.

In: `datasets/catalog.toml`, or your own catalogue, with the URL, size, hash and licence of every file. Out:
recordings in a local folder (COLLECTION/FILE), each with the hash that the catalogue states.
"""
