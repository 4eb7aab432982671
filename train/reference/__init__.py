"""The motion to imitate, sampled at any phase.

In: a `Motion` of `retarget`. Out: root, joint rotations, body states with velocities, and the feed-forward
targets that inverse dynamics gives.
"""
