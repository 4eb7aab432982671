"""Files of motions: motion.json, motion.mcap, gait.json and the humanoid's URDF; poses for other writers.

In: a `Motion`, or a file. Out: a file or text, or the checked `Motion` that a file holds.
"""
