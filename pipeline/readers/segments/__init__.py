"""Formats that hold the body's segments, their orientations and the joints between them: Xsens, AMASS, OpenSim.
In: a `Source`. Out: a `Clip` with the rotations as recorded.
"""
