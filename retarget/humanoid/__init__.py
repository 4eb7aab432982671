"""The simulated body of Table 1 and its motions: rigid bodies, joint limits, surface, and the `Motion` type.

Nothing comes in from other rooms of `retarget`; all of them, and training, build on these definitions.
"""
