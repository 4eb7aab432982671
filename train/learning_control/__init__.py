"""Iterative learning control of a policy: what it does wrong in every cycle of one motion, it unlearns.

In: a policy that walks. Out: a policy of the same shape.
"""
