"""Whole workflows: all stages of a run, the motions of many captures, training the shipped policies, checking their scores.

In: a capture, a recipe or a shipped policy. Out: a run folder with run.json, or the folder of policies.
"""
