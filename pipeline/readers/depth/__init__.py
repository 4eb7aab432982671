"""Depth recordings: a folder of depth frames with a TOML file about the camera. In: the folder. Out: a `Clip`
of the joints that were tracked in the frames, and the frames themselves as point clouds.
"""
