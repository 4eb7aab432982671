"""Writers of motion formats. In: a `Clip`, or `Poses` (a constant rate, nothing missing) made from one by
`poses_of_clip`. Out: files as BVH, TRC, MOT, CSV, NPZ, DeepMimic JSON or `.skl` text.
"""
