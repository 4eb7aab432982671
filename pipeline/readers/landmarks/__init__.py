"""Formats of programs that find people in pictures: MediaPipe and what is built on it, stereo cameras, depth
cameras with their own tracker. In: a `Source` or a folder. Out: a `Clip` of those of the 20 nodes that the
landmarks give.
"""
