"""Videos of a person, from a phone or any other camera that stands still. In: the file. Out: a `Clip` of the
20 nodes in metres above the floor, and the camera that sees them.
"""
