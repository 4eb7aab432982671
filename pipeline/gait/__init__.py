"""Gait analysis: detection of walking, foot contacts, spatiotemporal parameters, curves and norms.

In: times and positions (T, 20, 3) of the 20 nodes, or joint-angle curves. Out: foot events, strides,
parameters, mean curves over the gait cycle, and metrics of how well two curves agree.
"""
