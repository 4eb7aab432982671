"""Training of a policy that imitates a motion: simulation, task, PPO and its baselines.

In: a motion of `retarget` and a preset. Out: a run folder with a policy, a checkpoint and learning curves.
"""

import os

# Torch's OpenMP threads spin while they wait for each other. The default makes an update ten times slower on
# a busy machine; no spinning makes it 1.5 times slower on a quiet one. The variable is read once, when torch
# is first imported.
os.environ.setdefault("GOMP_SPINCOUNT", "2000")
