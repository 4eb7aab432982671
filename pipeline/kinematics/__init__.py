"""Mathematics of moving skeletons on arrays: rotations, Euler angles, clips, node orientations, joint angles.

In: arrays of positions (T, J, 3), quaternions (T, J, 4) and times, or a `Clip` of them. Out: the same on the
20-node skeleton, as joint angles, or on another clock. Reads and writes no files.
"""
