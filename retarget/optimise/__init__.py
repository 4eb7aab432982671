"""Refinement: all frames of a motion optimised together for foot contact, ground and joint limits.

In: a motion in closed form with its contacts and the visibility of its nodes. Out: the refined motion. The
solver is Gauss-Newton on a block-banded least-squares problem.
"""
