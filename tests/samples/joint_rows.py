"""A table of SMPL's 22 joints without names, as saving an array as text gives it."""

from __future__ import annotations

import io

import numpy as np

from kinemimic.pipeline.readers.landmarks.joint_sets import SETS
from samples.joint_array import joints
from samples.motion import walk

_SMPL = next(joint_set for joint_set in SETS if len(joint_set.joints) == 22)


def files(frames: int = 90) -> dict[str, bytes]:
    """Metres, Y up, at 20 Hz."""
    text = io.StringIO()
    np.savetxt(text, joints(walk(frames, _SMPL.rate), _SMPL).reshape(frames, -1), fmt="%.6f")
    return {"joints.txt": text.getvalue().encode()}
