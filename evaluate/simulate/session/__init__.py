"""Sessions: humanoids that people push while they perform a motion, and their recordings.

In: a motion or a live capture, a policy, and inputs with the control steps before which they act. Out: a
frame for each control step. A session knows neither a clock nor a page, so a recording replays to the last
bit.
"""
