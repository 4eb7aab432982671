"""The path over the ground, with the walker's axes along it: heading, upright axis, height of the ground.

In: positions of the 20 nodes of one pass on an even clock, and the phase of its strides. Out: for each frame
the direction in which the body faces, the upright axis and the height of the ground; the path by the feet,
and the path that a walk has.
"""
