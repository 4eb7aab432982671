"""Rollouts: a policy acts in a batch of simulated environments.

In: a motion or reference, a policy, an environment configuration. Out: trajectories, evaluations during
training, ONNX models. `rollout.roll_out` is the loop that all evaluations share.
"""
