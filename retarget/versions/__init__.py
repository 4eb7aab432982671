"""Data sets by version: built from raw recordings, locked, checked, and compared as motions."""
