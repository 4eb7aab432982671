"""Settings of a training and of its baselines, the presets, and their JSON.

In: a preset's name and changes, or a stored configuration. Out: a checked `TrainConfig`.
"""
