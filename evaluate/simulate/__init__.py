"""An interactive simulation in real time: the loop between a session (`session`) and its page (`page`).

In: a motion, a policy and what people do on the page. Out: recordings of sessions, which replay to the bit.
"""
