"""How well the figure walks: fit, survival, path, report and playback."""
