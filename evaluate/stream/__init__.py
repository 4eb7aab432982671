"""Live captures: frames from the network, standard input or a file drive the humanoid.

In: frames of a sender, with bounds on their size, number and rate. Out: the page of `simulate` or a summary,
and recordings that replay to the bit.
"""
