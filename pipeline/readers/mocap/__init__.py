"""Formats of motion-capture and animation software: BVH, ASF/AMC, C3D, DeepMimic. In: a `Source`. Out: a
`Clip` on the skeleton of the file, or on joint centres computed from its markers.
"""
