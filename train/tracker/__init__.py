"""Training of trackers, policies that perform any motion.

In: a motion library. Out: policy.safetensors and policy.json, as from training on one motion.
"""
