"""Left and right legs, or arms, that change places for some frames.

A tracker that confuses two limbs makes both of them jump at once, each to where the other was going. So the
exchange is looked for that makes the motion smoothest: over a pass, the sequence of "as named" and "the other
way round" with the least sum of the joints' deviations from going straight on, plus a price for each change
(Viterbi's algorithm; a frame's deviation depends on the last two changes only).
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import joints_of_nodes
from kinemimic.pipeline.kinematics.spans import frame_runs, runs
from kinemimic.pipeline.quality.rules.defect import Defect, plural
from kinemimic.pipeline.quality.rules.swap_sides import swap_sides

LIMBS: dict[str, tuple[str, ...]] = {"legs": ("knee", "ankle", "foot"), "arms": ("elbow", "wrist", "hand")}
# The joint that a limb hangs on may change places with it or not: the trunk is seen better than the limbs.
_HANGS_ON = {"legs": "hip", "arms": "shoulder"}
# Metres, mean over the limb's joints: a change must save more than PRICE of deviation, which a noisy crossing
# of the ankles does not. A deviation above MOST counts as MOST: it is a jump, whatever its size.
PRICE = 0.20
MOST = 0.5
# Longer than this (seconds) no tracker confuses limbs and then finds back; two such changes are two turns.
LONGEST = 1.0


def repair(clip: Clip) -> tuple[Clip, list[Defect]]:
    """The clip with limbs back on their sides, pass by pass; Euler captures are only flagged."""
    found = joints_of_nodes(clip.skeleton.names)
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
                curves = [name for name in clip.angles or () if name.startswith((_HANGS_ON[limb], *joints))]
                repaired = swap_sides(repaired, where, _with_ends(clip, pairs), curves)
                for pair in _pairs(found, (_HANGS_ON[limb],)):
                    repaired = swap_sides(repaired, _along(clip, pair, where), pair, ())
    if not swapped.any():
        return clip, []
    done = "put back" if clip.euler is None else "left as recorded: Euler channels cannot be exchanged"
    return repaired, [
        Defect(
            "swapped_sides",
            int(swapped.sum()),
            "frames",
            "repaired" if clip.euler is None else "flagged",
            f"left and right change places: {', '.join(parts)}; {done}",
            frame_runs(swapped),
        )
    ]


def _pairs(found: dict[str, int], joints: tuple[str, ...]) -> list[tuple[int, int]]:
    """Left and right joint of those that the skeleton has on both sides."""
    sides = (tuple(found.get(f"{joint}_{side}", -1) for side in ("left", "right")) for joint in joints)
    return [(left, right) for left, right in sides if left >= 0 and right >= 0]


def _along(clip: Clip, pair: tuple[int, int], where: Mask) -> Mask:
    """The stretches of `where` (T,) in which that pair jumps to each other's place too."""
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
    """Frames (T,) in which the limb is the other way round."""
    swapped = np.zeros(len(clip.times), dtype=np.bool_)
    both = clip.positions[:, pairs]  # (T, pairs, 2, 3)
    for number in range(int(clip.passes.max(initial=-1)) + 1):
        for span in runs(clip.passes == number):
            if span.stop - span.start >= 4:
                changes = _changes(_deviations(both[span], clip.times[span]))
                swapped[span] = _stretches(changes, clip.times[span])
    return swapped


def _deviations(both: Array, times: Array) -> Array:
    """Metres (T - 2, 2, 2) by which frame t + 2 leaves the straight line: [was there a change before it, is
    there one at it], as the names stand in frame t + 1; both: (T, P, 2, 3)."""
    ratio = np.clip(np.diff(times)[1:] / np.diff(times)[:-1], 0.25, 4.0)[:, None, None, None]
    middle = both[1:-1]
    cost = np.empty((len(both) - 2, 2, 2))
    for before in (0, 1):
        earlier = both[:-2, :, ::-1] if before else both[:-2]
        expected = middle + ratio * (middle - earlier)
        for at in (0, 1):
            there = both[2:, :, ::-1] if at else both[2:]
            off = np.linalg.norm(there - expected, axis=-1)
            seen = np.isfinite(off)
            total = np.where(seen, np.minimum(off, MOST), 0.0).sum(axis=(1, 2))
            cost[:, before, at] = total / np.maximum(seen.sum(axis=(1, 2)), 1)
    return cost


def _changes(cost: Array) -> Mask:
    """Frames (T,) at which the limbs change names, on the cheapest way through."""
    as_named, changed = 0.0, PRICE
    came: list[tuple[bool, bool]] = []
    for (stay, begin), (end, again) in cost.tolist():
        came.append((changed + end < as_named + stay, changed + again < as_named + begin))
        as_named, changed = (
            min(as_named + stay, changed + end),
            min(as_named + begin, changed + again) + PRICE,
        )
    changes = np.zeros(len(cost) + 2, dtype=np.bool_)
    state = changed < as_named
    for frame in range(len(cost) + 1, 0, -1):
        changes[frame] = state
        if frame > 1:
            state = came[frame - 2][int(state)]
    return changes


def _stretches(changes: Mask, times: Array) -> Mask:
    """Frames (T,) between an odd change and the next: the other way round, if that is the shorter part."""
    other = np.cumsum(changes) % 2 == 1
    if other.sum() > 0.5 * len(other):
        other = ~other
    for span in runs(other):
        if times[span.stop - 1] - times[span.start] > LONGEST:
            other[span] = False
    return np.asarray(other)


def _with_ends(clip: Clip, pairs: list[tuple[int, int]]) -> list[int]:
    """The joints of pairs and all that hangs on them: a hand's tip and thumb go with the hand."""
    joints = {joint for pair in pairs for joint in pair}
    for joint, parent in enumerate(clip.skeleton.parents):
        if parent in joints:
            joints.add(joint)
    return sorted(joints)
