"""Retargeting: recorded skeletons become motions of the simulated humanoid (Table 1 of the paper).

In: a converted capture (`quaternions.parquet`, `raw.parquet`). Out: the motion (`motion.json`, `motion.mcap`),
its report (`gait.json`) and the recorded joint angles by phase of the motion (`capture.parquet`).
"""
