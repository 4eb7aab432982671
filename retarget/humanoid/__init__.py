"""The simulated body of Table 1 and its motions: rigid bodies, joint limits, surface, and the `Motion` type.

It imports nothing from the other rooms of `retarget`; they and the training build on these definitions.
"""
