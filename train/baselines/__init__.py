"""Baselines from stable-baselines3 (DDPG, A2C, PPO) on the same task, trained and stored like our own PPO.

In: a training configuration with a `baseline`. Out: an `Algorithm` and a `Runner` (train/runner/base.py).
"""
