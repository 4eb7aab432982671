"""Whole workflows: all stages of a run, batches of captures, training the shipped policies, checking scores.

In: captures, a recipe or a shipped policy. Out: run folders with run.json and the table of a batch, or the
folder of policies.
"""
