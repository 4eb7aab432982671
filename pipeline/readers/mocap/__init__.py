"""Formats of motion-capture and biomechanics software: BVH, ASF/AMC, C3D, TRC, MOT, DeepMimic. In: a
`Source`. Out: a `Clip` on the skeleton of the file, or on joint centres computed from its markers.
"""
