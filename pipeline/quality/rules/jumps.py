"""Detects joints that leave their path for a single frame, and marks them missing so that they are filled.

The whole body may also leave its place for some frames (`displaced_body`).

Euler captures are only flagged.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import MISSING
from kinemimic.pipeline.kinematics.spans import frame_runs
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.frame_selection import empty_frames
from kinemimic.pipeline.quality.rules.repeated_poses import MAX_ABSENCE

# The joint is off the line between its two neighbouring frames by more than a Kinect's noise (metres) …
MIN_DEVIATION = 0.10
# … and by more than the greatest acceleration of a hand or foot (m/s²) explains; a kick or a throw reaches
# about 200, a stride less than 60.
MAX_ACCELERATION = 200.0
# Without the jump the neighbouring frames are off their own lines by less than this share of it. Otherwise
# (a body that enters the view, a joint that moves to another place) it is unknown which positions are wrong.
MAX_NEIGHBOUR_RATIO = 0.4


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip with the jumped positions set to missing."""
    if len(clip.times) < 5:
        return clip, []
    off = np.zeros(clip.states.shape)
    off[1:-1] = _off_line(clip, 1, 1)
    around = np.full(clip.states.shape, np.inf)
    around[2:-2] = np.maximum(_off_line(clip, 1, 2)[:-1], _off_line(clip, 2, 1)[1:])
    steps = np.diff(clip.times)
    limit = np.full(len(clip.times), np.inf)
    limit[1:-1] = np.maximum(MIN_DEVIATION, 0.5 * MAX_ACCELERATION * steps[:-1] * steps[1:])
    whole = np.zeros(len(clip.times), dtype=np.bool_)
    whole[2:-2] = (clip.passes[2:-2] >= 0) & (clip.passes[:-4] == clip.passes[4:])
    with np.errstate(invalid="ignore"):
        jumps = whole[:, None] & (off > limit[:, None]) & (around < MAX_NEIGHBOUR_RATIO * off)
    count = int(jumps.sum())
    if not count:
        return clip, []
    per_joint = jumps.sum(axis=0)
    worst = np.argsort(-per_joint, kind="stable")[:3]
    names = ", ".join(f"{clip.skeleton.names[j]} {per_joint[j]}" for j in worst if per_joint[j])
    largest = float(off[jumps].max())
    text = f"{plural(count, 'joint position')} off for one frame, up to {largest:.2f} m (most: {names}); "
    frames = frame_runs(np.asarray(jumps.any(axis=1)))
    if clip.euler is not None:
        text += "left as recorded: Euler channels cannot be filled"
        return clip, [Defect("jumps", count, "joint positions", "flagged", text, frames)]
    positions, states = clip.positions.copy(), clip.states.copy()
    positions[jumps], states[jumps] = np.nan, MISSING
    rotations = clip.rotations
    if rotations is not None:
        # The recorder computed them from the wrong positions.
        rotations = rotations.copy()
        rotations[jumps] = np.nan
    text += "removed, to be filled"
    return replace(clip, positions=positions, states=states, rotations=rotations), [
        Defect("jumps", count, "joint positions", "repaired", text, frames)
    ]


def repair_body(clip: Clip, displaced: Mask) -> tuple[Clip, list[Defect]]:
    """The clip without the positions of frames in its passes in which the whole body is displaced."""
    displaced = displaced & (clip.passes >= 0)
    count = int(displaced.sum())
    if not count:
        return clip, []
    text = (
        f"the whole body is in another place in {plural(count, 'frame')}, and back within {MAX_ABSENCE} s; "
    )
    frames = frame_runs(displaced)
    if clip.euler is not None:
        text += "left as recorded: Euler channels cannot be filled"
        return clip, [Defect("jumps", count, "frames", "flagged", text, frames)]
    text += "removed, to be filled"
    return empty_frames(clip, displaced), [Defect("jumps", count, "frames", "repaired", text, frames)]


def _off_line(clip: Clip, before: int, after: int) -> Array:
    """Distance (T - before - after, J) in metres of each joint from the line between two other frames.

    The line runs from `before` frames earlier to `after` frames later; the first row is frame `before`.
    """
    rows = len(clip.times) - before - after
    first, middle, last = (slice(k, k + rows) for k in (0, before, before + after))
    times = clip.times
    share = ((times[middle] - times[first]) / (times[last] - times[first]))[:, None, None]
    p = clip.positions
    return np.asarray(np.linalg.norm(p[middle] - p[first] - share * (p[last] - p[first]), axis=-1))
