"""Training of trackers, policies that perform any motion.

In: a motion library. Out: policy.safetensors and policy.json, as of a training on one motion.
"""
