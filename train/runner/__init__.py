"""The training loop for any algorithm: rounds of rollout and update, evaluations, checkpoints.

In: an `Algorithm` and its `Runner`. Out: the trained state, a checkpoint file, TensorBoard curves.
"""
