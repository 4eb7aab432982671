"""Robustness of a trained policy: pushes of increasing force, and trials of scenarios with paired controls.

In: a run folder with a policy and its motion. Out: pushes.json, scenario-NAME.json, and tables.
"""
