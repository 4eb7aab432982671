"""Whole workflows: all stages of a run, training the shipped policies, checking scores.

In: a capture, a recipe or a shipped policy. Out: a run folder with run.json, or the folder of policies.
"""
