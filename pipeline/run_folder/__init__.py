"""Run folders: one command at a time, results that appear together, and no mixture of two captures."""
