"""A capture that arrives frame by frame: decoded, put on the 20 nodes, cleaned with a fixed lag.

In: frames with a time stamp and 20, 25, 32 or 33 joints. Out: positions of the 20 nodes on an even clock,
which depend on no frame later than the lag.
"""
