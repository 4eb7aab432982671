"""Detects joints that are missing inside a pass, and reports which gaps are short enough to be filled.

"repaired" if `filters.fill` will fill every gap, else flagged; longer gaps stay.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.filters.fill import LONGEST_GAP
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import MISSING
from kinemimic.pipeline.kinematics.spans import frame_runs
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.defect import Defect


def detect(clip: Clip) -> list[Defect]:
    """The defect "gaps" of a clip with numbered passes."""
    inside = clip.passes >= 0
    missing = (clip.states == MISSING) & inside[:, None]
    never = missing.sum(axis=0) == inside.sum()
    missing[:, never] = False
    missing_count = int(missing.sum())
    never_seen = [clip.skeleton.names[joint] for joint in np.flatnonzero(never)] if inside.any() else []
    if not missing_count and not never_seen:
        return []
    count, filled, ends, longest = _gaps(clip, missing)
    parts = []
    # There, even a gap of one frame stays: nothing is known beyond it.
    at_ends = f" ({ends} at the start or end of a pass)" if ends else ""
    if missing_count:
        parts.append(
            f"{plural(missing_count, 'joint position')} missing in {plural(count, 'gap')} inside passes, the "
            f"longest {longest:.2f} s: {filled} of up to {LONGEST_GAP} s will be filled, "
            f"{count - filled} will stay{at_ends}"
        )
    if never_seen:
        parts.append(f"never seen: {', '.join(never_seen)}")
    all_filled = count == filled and not never_seen
    return [
        Defect(
            "gaps",
            missing_count if missing_count else len(never_seen),
            "joint positions" if missing_count else "joints",
            "repaired" if all_filled else "flagged",
            "; ".join(parts),
            frame_runs(missing.any(axis=1)),
        )
    ]


def _gaps(clip: Clip, missing: np.typing.NDArray[np.bool_]) -> tuple[int, int, int, float]:
    """Numbers of gaps, of those to be filled, and of those at an end of a pass; the longest, s."""
    step = float(np.median(np.diff(clip.times)))
    # A gap ends with its pass: an inserted row between passes separates gaps in adjacent passes.
    starts = np.flatnonzero(np.diff(clip.passes)) + 1
    broken = np.insert(missing, starts, False, axis=0)
    frame = np.insert(np.arange(len(clip.times)), starts, -1)
    edge = np.zeros((1, broken.shape[1]), dtype=np.int8)
    change = np.diff(np.concatenate([edge, broken.astype(np.int8), edge]), axis=0)
    first, last = np.argwhere(change.T == 1)[:, 1], np.argwhere(change.T == -1)[:, 1] - 1
    first, last = frame[first], frame[last]
    before, after = np.maximum(first - 1, 0), np.minimum(last + 1, len(clip.times) - 1)
    bounded = (clip.passes[before] == clip.passes[first]) & (clip.passes[after] == clip.passes[last])
    bounded &= (before < first) & (after > last)
    across = clip.times[after] - clip.times[before]
    filled = bounded & (across <= LONGEST_GAP + step + 1e-6)
    longest = float((clip.times[last] - clip.times[first] + step).max()) if len(first) else 0.0
    return len(first), int(filled.sum()), int((~bounded).sum()), longest
