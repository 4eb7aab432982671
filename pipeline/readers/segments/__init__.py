"""Formats that hold the body's segments, their orientations and joints: Xsens, AMASS, OpenSim.
In: a `Source`. Out: a `Clip` with the rotations as recorded.
"""
