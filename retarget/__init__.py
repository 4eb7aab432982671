"""Retargeting: turns recorded skeletons into motions of the simulated humanoid (Table 1).

In: a converted capture (`quaternions.parquet`, `raw.parquet`). Out: a motion (`motion.json`, `motion.mcap`),
its report (`gait.json`) and the recorded joint angles by phase of the motion (`capture.parquet`).
"""
