"""Formats in which public Kinect data sets are distributed. In: a `Source`. Out: a `Clip` on that data set's
joints. Files without a header are recognised by their shape and by whether the numbers form an upright body.
"""
