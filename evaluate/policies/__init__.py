"""The policies that ship with kinemimic.

In: the name of a policy, and its recording if that may not be redistributed. Out: a run folder with the
policy and its motion.
"""
