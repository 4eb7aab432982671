"""Settings of training and of the baselines, the presets, and their JSON.

In: a preset's name and changes, or a stored configuration. Out: a checked `TrainConfig`.
"""
