"""The Bullet world, the imitation rewards and the learner."""

import os

# Torch's OpenMP threads spin while they wait for one another. Left to itself the spinning makes an update ten
# times as long on a machine that does anything else; without any, it takes half as long again on a quiet one.
# The variable is read once, when torch is first imported.
os.environ.setdefault("GOMP_SPINCOUNT", "2000")
