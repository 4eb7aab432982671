"""Comparisons: train and score tasks, presets and seeds, in parallel and resumable.

Reads the motions of run folders; writes compare.json, compare.csv and one run folder per cell. Aggregates
seeds into learning curves with confidence intervals.
"""
