"""Recoveries from pushes that a trained policy does not survive: found by search, learned by regression."""
