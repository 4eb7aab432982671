"""The simulated body of Table 1 and its motions: rigid bodies, joint limits, surface, and the `Motion` type.

It imports nothing from the other packages of `retarget`; they and `train` build on these definitions.
"""
