"""Named arrays of numbers in a file: numpy's and MATLAB's.

In: a bounded `Source`. Out: names, shapes and arrays. Nothing is unpickled, and nothing is larger than it
claims.
"""
