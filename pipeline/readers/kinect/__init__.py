"""Formats that Kinect recorders write. In: a `Source`. Out: a `Clip` on the joints of that sensor's SDK, with
its tracking states and, where the file has them, its joint orientations.
"""
