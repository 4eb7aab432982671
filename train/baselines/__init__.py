"""Baselines of stable-baselines3 (DDPG, TD3, SAC, A2C, PPO), trained on the same task and stored as our PPO.

In: a training configuration with a `baseline`. Out: an `Algorithm` and a `Runner` (train/runner/base.py).
"""
