"""Evaluation of trained policies: scores, gait, robustness, views, exports, comparisons and experiments.

In: run folders with motion and policy. Out: scores, reports, recordings and exported files.
"""
