"""The Bullet world, the imitation rewards and the learner."""

import os

# Torch's OpenMP threads otherwise spin while they wait for one another: on a machine that does anything else
# besides, an update takes ten times as long. It is read once, when torch is first imported.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
