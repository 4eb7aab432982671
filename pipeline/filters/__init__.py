"""Cleaning of a capture: fill short gaps, remove noise and outliers, pass by pass.

In: a clip as recorded and the name of a filter. Out: the same frames cleaned, and masks of what changed.
"""
