"""The experiments: which policies take part, contests of several policies, walks through rooms, update times.

In: policies and scenarios. Out: rows of numbers, one for each trial, walk or update.
"""
