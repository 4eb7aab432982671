"""Detects left and right legs, or arms, that are swapped for some frames, and swaps them back.

A sensor that confuses two limbs makes both jump at once, each to the place of the other. The rule finds the
assignment of sides that makes the motion of a pass smoothest: the sequence of "as named" and "swapped" with
the least sum of the joints' deviations from linear extrapolation, plus a penalty per change (Viterbi
algorithm; the deviation of a frame depends on the last two changes only). Euler captures are only flagged.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.joint_names import joints_by_name
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.kinematics.spans import frame_runs, runs
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.swap_sides import swap_sides

LIMBS: dict[str, tuple[str, ...]] = {"legs": ("knee", "ankle", "foot"), "arms": ("elbow", "wrist", "hand")}
# The joint that a limb is attached to may be swapped with it or not: the trunk is tracked better.
_ATTACHED_TO = {"legs": "hip", "arms": "shoulder"}
# Metres, mean over the limb's joints: a change must save more than CHANGE_PENALTY of deviation, which a noisy
# crossing of the ankles does not. Deviations are clipped at MAX_DEVIATION, beyond which they are jumps.
CHANGE_PENALTY = 0.20
MAX_DEVIATION = 0.5
# Seconds. Trackers recover from a swap sooner; changes farther apart are two turns of the body.
MAX_SWAP_DURATION = 1.0


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip with swapped limbs put back on their sides, pass by pass."""
    found = joints_by_name(clip.skeleton.names)
    swapped = np.zeros(len(clip.times), dtype=np.bool_)
    parts: list[str] = []
    repaired = clip
    for limb, joints in LIMBS.items():
        pairs = _pairs(found, joints)
        if len(pairs) < 2:
            continue
        where = _swapped(clip, pairs)
        if where.any():
            parts.append(
                f"{limb} in {plural(int(where.sum()), 'frame')} ({plural(len(list(runs(where))), 'time')})"
            )
            swapped |= where
            if clip.euler is None:
                curves = [
                    name for name in clip.angles or () if name.startswith((_ATTACHED_TO[limb], *joints))
                ]
                repaired = swap_sides(repaired, where, _with_descendants(clip, pairs), curves)
                for pair in _pairs(found, (_ATTACHED_TO[limb],)):
                    repaired = swap_sides(repaired, _swapped_along(clip, pair, where), pair, ())
    if not swapped.any():
        return clip, []
    done = "swapped back" if clip.euler is None else "left as recorded: Euler channels cannot be swapped"
    return repaired, [
        Defect(
            "swapped_sides",
            int(swapped.sum()),
            "frames",
            "repaired" if clip.euler is None else "flagged",
            f"the sensor confused the sides: {', '.join(parts)}; {done}",
            frame_runs(swapped),
        )
    ]


def _pairs(found: dict[str, int], joints: tuple[str, ...]) -> list[tuple[int, int]]:
    """Indices (left, right) of the joints that the skeleton has on both sides."""
    sides = (tuple(found.get(f"{joint}_{side}", -1) for side in SIDES) for joint in joints)
    return [(left, right) for left, right in sides if left >= 0 and right >= 0]


def _swapped_along(clip: Clip, pair: tuple[int, int], where: Mask) -> Mask:
    """The runs of `where` (T,) in which this pair of joints is swapped too."""
    places = clip.positions[:, list(pair)]  # (T, 2, 3)
    along = np.zeros(len(where), dtype=np.bool_)
    for span in runs(where):
        edges = np.array([(span.start, span.start - 1), (span.stop - 1, span.stop)])
        edges = edges[(edges >= 0).all(axis=1) & (edges < len(where)).all(axis=1)]
        inner, outer = edges[clip.passes[edges[:, 0]] == clip.passes[edges[:, 1]]].T
        straight = np.linalg.norm(places[inner] - places[outer], axis=-1)
        crossed = np.linalg.norm(places[inner] - places[outer][:, ::-1], axis=-1)
        seen = np.isfinite(straight) & np.isfinite(crossed)
        along[span] = bool(np.sum(crossed[seen]) < np.sum(straight[seen]))
    return along


def _swapped(clip: Clip, pairs: list[tuple[int, int]]) -> Mask:
    """Frames (T,) in which the limb is swapped."""
    swapped = np.zeros(len(clip.times), dtype=np.bool_)
    both = clip.positions[:, pairs]  # (T, pairs, 2, 3)
    for number in range(int(clip.passes.max(initial=-1)) + 1):
        for span in runs(clip.passes == number):
            if span.stop - span.start >= 4:
                changes = _changes(_deviations(both[span], clip.times[span]))
                swapped[span] = _stretches(changes, clip.times[span])
    return swapped


def _deviations(both: Array, times: Array) -> Array:
    """Deviation (T - 2, 2, 2) in metres of frame t + 2 from linear extrapolation.

    Indexed by [change at frame t + 1, change at frame t + 2], relative to the names in frame t + 1.
    both: (T, P, 2, 3), left and right joint of each pair.
    """
    ratio = np.clip(np.diff(times)[1:] / np.diff(times)[:-1], 0.25, 4.0)[:, None, None, None]
    middle = both[1:-1]
    cost = np.empty((len(both) - 2, 2, 2))
    for before in (0, 1):
        earlier = both[:-2, :, ::-1] if before else both[:-2]
        expected = middle + ratio * (middle - earlier)
        for at in (0, 1):
            position = both[2:, :, ::-1] if at else both[2:]
            off = np.linalg.norm(position - expected, axis=-1)
            seen = np.isfinite(off)
            total = np.where(seen, np.minimum(off, MAX_DEVIATION), 0.0).sum(axis=(1, 2))
            cost[:, before, at] = total / np.maximum(seen.sum(axis=(1, 2)), 1)
    return cost


def _changes(cost: Array) -> Mask:
    """Frames (T,) at which the limbs are swapped or swapped back, on the path of least cost."""
    as_named, changed = 0.0, CHANGE_PENALTY
    came: list[tuple[bool, bool]] = []
    for (stay, begin), (end, again) in cost.tolist():
        came.append((changed + end < as_named + stay, changed + again < as_named + begin))
        as_named, changed = (
            min(as_named + stay, changed + end),
            min(as_named + begin, changed + again) + CHANGE_PENALTY,
        )
    changes = np.zeros(len(cost) + 2, dtype=np.bool_)
    state = changed < as_named
    for frame in range(len(cost) + 1, 0, -1):
        changes[frame] = state
        if frame > 1:
            state = came[frame - 2][int(state)]
    return changes


def _stretches(changes: Mask, times: Array) -> Mask:
    """Swapped frames (T,): those between an odd change and the next, or their complement if it is shorter."""
    other = np.cumsum(changes) % 2 == 1
    if other.sum() > 0.5 * len(other):
        other = ~other
    for span in runs(other):
        if times[span.stop - 1] - times[span.start] > MAX_SWAP_DURATION:
            other[span] = False
    return np.asarray(other)


def _with_descendants(clip: Clip, pairs: list[tuple[int, int]]) -> list[int]:
    """The joints of the pairs and their descendants, such as the tip and thumb of a hand."""
    joints = {joint for pair in pairs for joint in pair}
    for joint, parent in enumerate(clip.skeleton.parents):
        if parent in joints:
            joints.add(joint)
    return sorted(joints)
