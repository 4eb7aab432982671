"""Iterative learning control: a policy unlearns the errors that it makes in every cycle of one motion.

In: a policy that walks. Out: a policy of the same shape.
"""
