"""The phase of a gait: a number that rises by one with every stride.

In: times and the positions of the ankles. Out: the phase of each frame, and Fourier series in a phase, which
smooth, average and close a cycle.
"""
