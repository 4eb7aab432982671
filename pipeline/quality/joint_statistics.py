"""Per joint: shares of tracked, inferred and missing frames, and the length of the bone to its parent."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Mask
from kinemimic.pipeline.files.json_layout import rounded
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, TRACKED


def joint_statistics(clip: Clip, inside: Mask) -> dict[str, dict[str, float | None]]:
    """Statistics over the frames `inside` (T,), by joint name.

    tracked, inferred, missing: shares of the frames; bone_m: median length in metres; bone_cv: coefficient of
    variation (standard deviation over mean). The bone values are None for a root and for a bone that was
    never seen or has no length.
    """
    report: dict[str, dict[str, float | None]] = {}
    for joint, name in enumerate(clip.skeleton.names):
        states, parent = clip.states[inside, joint], clip.skeleton.parents[joint]
        length = variation = None
        if parent >= 0:
            bone = np.linalg.norm(clip.positions[inside, joint] - clip.positions[inside, parent], axis=-1)
            bone = bone[np.isfinite(bone)]
            if len(bone) and np.median(bone) > 1e-6:
                length, variation = rounded(np.median(bone), 4), rounded(np.std(bone) / np.mean(bone), 4)
        report[name] = {
            "tracked": share(states == TRACKED),
            "inferred": share(states == INFERRED),
            "missing": share(states == MISSING),
            "bone_m": length,
            "bone_cv": variation,
        }
    return report


def share(mask: Mask) -> float | None:
    """The share of True values, four decimals; None for an empty array."""
    return rounded(np.mean(mask), 4) if mask.size else None
