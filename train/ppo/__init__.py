"""PPO with explicit gradients: actor and critic, the clipped objective, the update, and its runner.

In: samples of a rollout. Out: an updated policy, and quantities to log.
"""
