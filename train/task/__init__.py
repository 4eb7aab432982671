"""The imitation task: observation, action, reward, termination, domain randomization and mirroring.

In: a world, a reference and an `EnvConfig`. Out: `ImitationBatch`, which steps a batch of environments.
"""
