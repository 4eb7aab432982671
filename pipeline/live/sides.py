"""Left and right of a live capture: limbs that the sender swaps for some frames, and bodies seen from behind.

Offline, the rules of `quality/rules` look at a whole pass. Here a frame is compared with where its limbs were
going, and the body's front is an average over the past.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kinemimic.pipeline.arrays import Array, States
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES, SIDES
from kinemimic.pipeline.quality.rules.swapped_limbs import (
    CHANGE_PENALTY,
    LIMBS,
    MAX_DEVIATION,
    MAX_SWAP_DURATION,
)

# Seconds over which the evidence for the body's front is averaged.
FRONT_TIME = 0.6
# A body is reversed if its knees point to the back that hips and shoulders show (-1 to 1), and it moves to
# its back (m/s) or its toes point there; it is itself again where knees and movement say so. Kinects assume
# that everybody faces them; nobody's knees bend forward in walking backward.
KNEES, SPEED, TOES = (-0.2, 0.05), (-0.4, 0.2), (-0.3, 0.0)
# Sine of the bend from which a knee shows where its front is.
BENT = 0.15

_MIRROR = np.array(
    [
        N[
            name.replace("_left", "_?").replace("_right", "_left").replace("_?", "_right")
            if name.endswith(("_left", "_right"))
            else name
        ]
        for name in NODES
    ]
)
_PAIRS = {
    limb: np.array([[N[f"{joint}_{side}"] for side in SIDES] for joint in joints])
    for limb, joints in LIMBS.items()
}


@dataclass
class _Limb:
    """What a limb did: its last two places (K, 2, 3) with their times, and since when it is swapped."""

    places: list[Array] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    since: float | None = None


class Sides:
    """Puts the limbs of each frame on their sides.

    before: whose counts go on; swaps, reversals: numbers of frames repaired; turned: whether the body changed
    its sides in the last frame.
    """

    def __init__(self, before: Sides | None = None) -> None:
        self.swaps: int = 0 if before is None else before.swaps
        self.reversals: int = 0 if before is None else before.reversals
        self.turned = False
        self._limbs = {limb: _Limb() for limb in LIMBS}
        self._evidence = np.zeros(3)  # of knees, speed and toes
        self._reversed = False
        self._last: tuple[float, Array] | None = None

    def restored(self, time: float, positions: Array, states: States) -> tuple[Array, States]:
        """Positions (20, 3) and states (20,) at `time`, each limb on its own side."""
        order, swapped = np.arange(len(NODES)), False
        for limb, pairs in _PAIRS.items():
            if self._swapped(self._limbs[limb], time, positions[pairs]):
                order[pairs] = order[pairs[:, ::-1]]
                swapped = True
        self.swaps += swapped
        positions, states = positions[order], states[order]
        if self._is_reversed(time, positions):
            positions, states = positions[_MIRROR], states[_MIRROR]
            self.reversals += 1
        return positions, states

    def _swapped(self, limb: _Limb, time: float, both: Array) -> bool:
        """Whether a limb's joints (K, 2, 3) are on the wrong side, by linear extrapolation."""
        if limb.since is not None and time - limb.since > MAX_SWAP_DURATION:
            # No tracker confuses limbs for so long: what is called left is left again.
            limb.places.clear()
            limb.times.clear()
            limb.since = None
        swapped = False
        if len(limb.places) == 2 and time - limb.times[-1] < 0.2:
            (earlier, before), (t0, t1) = limb.places, limb.times
            expected = before + np.clip((time - t1) / max(t1 - t0, 1e-3), 0.25, 4.0) * (before - earlier)
            as_named, other = _deviation(both, expected), _deviation(both[:, ::-1], expected)
            swapped = bool(other + CHANGE_PENALTY < as_named)
        limb.since = (time if limb.since is None else limb.since) if swapped else None
        limb.places = [*limb.places, both[:, ::-1] if swapped else both][-2:]
        limb.times = [*limb.times, time][-2:]
        return swapped

    def _is_reversed(self, time: float, positions: Array) -> bool:
        """Whether the body has shown its back in place of its front for a while."""
        hips = 0.5 * (positions[N["hip_left"]] + positions[N["hip_right"]])
        before, self._last = self._last, (time, hips)
        was = self._reversed
        if before is not None and 0.0 < time - before[0] < 0.2:
            step = time - before[0]
            found = front_evidence(positions, (hips - before[1]) / step)
            share = np.where(np.isfinite(found), step / FRONT_TIME, 0.0)
            self._evidence += share * (np.nan_to_num(found) - self._evidence)
            knees, speed, toes = self._evidence
            if was:
                self._reversed = not (knees > KNEES[1] and (speed > SPEED[1] or toes > TOES[1]))
            else:
                self._reversed = bool(knees < KNEES[0] and (speed < SPEED[0] or toes < TOES[0]))
        self.turned = was != self._reversed
        return self._reversed


def _deviation(both: Array, expected: Array) -> float:
    """Mean distance of joints (K, 2, 3) that are seen; 0 without any."""
    off = np.linalg.norm(both - expected, axis=-1)
    seen = off[np.isfinite(off)]
    return float(np.minimum(seen, MAX_DEVIATION).mean()) if len(seen) else 0.0


def front_evidence(positions: Array, velocity: Array) -> Array:
    """What tells the front of a body (20, 3) that moves with `velocity` (3,) m/s, against the front that its
    hips and shoulders show: how clearly the knees bend to it, -1 to 1; the speed to it, m/s; the cosine of
    the toes. NaN where nothing shows."""
    left = positions[N["hip_left"]] - positions[N["hip_right"]]
    left = left + np.nan_to_num(positions[N["shoulder_left"]] - positions[N["shoulder_right"]])
    up = positions[N["shoulder_center"]] - 0.5 * (positions[N["hip_left"]] + positions[N["hip_right"]])
    front = np.cross(left, up)
    size = np.linalg.norm(front)
    if not size > 1e-6:
        return np.full(3, np.nan)
    front = front / size
    knees, weights, toes = 0.0, 0.0, list[float]()
    for side in SIDES:
        hip, knee, ankle, toe = (
            positions[N[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle", "foot")
        )
        thigh, shank, leg, foot = knee - hip, ankle - knee, ankle - hip, toe - ankle
        if (length := np.linalg.norm(foot)) > 1e-6:
            toes.append(float(foot @ front / length))
        lengths, leg_length = np.linalg.norm(thigh) * np.linalg.norm(shank), np.linalg.norm(leg)
        if not (lengths > 1e-6 and leg_length > 1e-6):
            continue
        bend = float(np.linalg.norm(np.cross(thigh, shank)) / lengths)
        aside = thigh - (thigh @ leg) / leg_length**2 * leg
        if bend > BENT and (length := np.linalg.norm(aside)) > 1e-6:
            knees += bend * float(aside @ front) / float(length)
            weights += bend
    return np.array(
        [
            knees / weights if weights else np.nan,
            float(velocity @ front),
            float(np.mean(toes)) if toes else np.nan,
        ]
    )
