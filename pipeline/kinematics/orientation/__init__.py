"""Orientations of the body segments: from the positions of the nodes, or from recorded rotations.

In: positions of the 20 nodes, or a clip with the rotations of any skeleton. Out: the rotations of the 20
nodes.
"""
