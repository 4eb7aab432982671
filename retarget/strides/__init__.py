"""Passes, strides and the gait loop: the frames that show walking, their phase, and their average stride.

In: a clip on the 20 nodes. Out: judged passes with a heading and a phase, their pooled strides, the
reliability of the sensor, and the gait loop as Fourier series.
"""
