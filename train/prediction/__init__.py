"""Prediction of the next 0.4 s of a motion, so that a policy need not wait for them, and removal of noise.

In: a motion library. Out: predictor.safetensors and predictor.json.
"""
