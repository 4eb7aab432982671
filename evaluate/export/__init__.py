"""Motions of a run, its policy and the body as files for other programs."""
