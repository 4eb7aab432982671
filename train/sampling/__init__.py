"""Samples for training: a policy explores in many environments, on the cores of this machine or on Ray.

In: a motion or reference, a policy, an environment configuration. Out: observations, actions and rewards of
control steps. `sampler.EnvSampler` simulates in one process, `workers.Workers` in all of them.
"""
