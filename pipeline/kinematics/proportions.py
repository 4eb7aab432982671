"""Nodes that a capture does not show, derived from the proportions of an average body.

Lengths are shares of stature: Drillis & Contini 1966, as drawn in Winter 2009 (Biomechanics and Motor Control
of Human Movement), Fig. 4.1. Stature follows from the thighs and shanks, which every capture must show. Arms
and hands hang along the trunk, and a foot points where the pelvis does, at a right angle to its shank. These
poses mean "unknown"; they are not measurements.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kinemimic.pipeline.arrays import Array, States
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, NODE_INDEX, NODES, SIDES
from kinemimic.pipeline.kinematics.vectors import perpendicular, unit

# Shares of stature.
THIGH, SHANK = 0.245, 0.246
TRUNK = 0.818 - 0.530  # from the height of the hips to that of the shoulders
HEAD = 0.936 - 0.818  # from the shoulders to the eyes, the height of a head's centre
HALF_SHOULDERS = 0.129
UPPER_ARM, FOREARM = 0.186, 0.146
FOOT = 0.110  # from the ankle to the toes: the foot's 0.152 less the heel
# Metres from the wrist to the palm, where a Kinect sees the hand.
HAND = 0.08
# Distance of the hip joints as a share of the leg, thigh and shank: the usual one (0.20 to 0.25 in optical
# captures of nine people), and more than in any other collection (0.30).
HIPS, WIDEST_HIPS = 0.22, 0.32
_HIPS = ("hip_left", "hip_right")
_ENDS = ("hip_center", "shoulder_center")


def stature(positions: Array) -> float:
    """Stature in metres from the median leg in positions (T, 20, 3); NaN if no frame shows a leg."""
    legs = []
    for side in SIDES:
        hip, knee, ankle = (positions[:, NODE_INDEX[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle"))
        length = np.linalg.norm(hip - knee, axis=-1) + np.linalg.norm(knee - ankle, axis=-1)
        legs.append(length[np.isfinite(length)])
    seen = np.concatenate(legs)
    return float(np.median(seen)) / (THIGH + SHANK) if len(seen) else np.nan


def hips_to_leg(positions: Array) -> float:
    """Median distance of the hips in positions (T, 20, 3) as a share of the leg; NaN without either."""
    left, right = (positions[:, NODE_INDEX[hip]] for hip in _HIPS)
    apart = np.linalg.norm(left - right, axis=-1)
    seen = apart[np.isfinite(apart)]
    leg = stature(positions) * (THIGH + SHANK)
    return float(np.median(seen)) / leg if len(seen) and leg > 0.0 else np.nan


def hip_narrowing(positions: Array) -> float:
    """Factor on the distance of the hips that makes them a person's hip joints; 1.0 if they may be.

    positions: (T, 20, 3), in any unit. Some trackers put the hips at the outside of the pelvis.
    """
    share = hips_to_leg(positions)
    return HIPS / share if share > WIDEST_HIPS else 1.0


def narrow_hips(positions: Array, states: States, hips: tuple[int, int], factor: float) -> None:
    """Bring two joints, the hips, together to `factor` of their distance, in place.

    positions: (..., J, 3); states: (..., J). A hip counts as missing where the other is: it is not known
    where it belongs.
    """
    left, right = (positions[..., hip, :].copy() for hip in hips)
    middle, half = 0.5 * (left + right), 0.5 * factor * (left - right)
    for hip, place in zip(hips, (middle + half, middle - half), strict=True):
        positions[..., hip, :] = place
        states[..., hip] = np.where(np.isfinite(place).all(axis=-1), states[..., hip], MISSING)


def complete(positions: Array, states: States, found: set[str]) -> None:
    """Fill the nodes that are not in `found` into positions (T, 20, 3) and states (T, 20), in place.

    Needs both hips, knees and ankles, and the spine, the shoulder_center or both shoulders. A derived node is
    "inferred" at best, and missing (NaN) in every frame in which a node that it follows from is missing.
    """
    if len(found) == len(NODES):
        return
    body = _Body(positions, states, stature(positions))
    for node, needs, place in _rules(body, found):
        index = NODE_INDEX[node]
        positions[:, index] = place
        least = states[:, [NODE_INDEX[need] for need in needs]].min(axis=1)
        states[:, index] = np.minimum(least, INFERRED)
        unknown = ~np.isfinite(place).all(axis=-1)
        positions[unknown, index], states[unknown, index] = np.nan, MISSING


class _Body:
    def __init__(self, positions: Array, states: States, stature: float) -> None:
        self.positions, self.states, self.stature = positions, states, stature

    def __getitem__(self, node: str) -> Array:
        return self.positions[:, NODE_INDEX[node]]

    @property
    def up(self) -> Array:
        """(T, 3) along the trunk."""
        return unit(self["shoulder_center"] - self["hip_center"])

    @property
    def left(self) -> Array:
        """(T, 3) from the right to the left hip, at right angles to the trunk."""
        return unit(perpendicular(self["hip_left"] - self["hip_right"], self.up))


Rule = tuple[str, tuple[str, ...], Array]


def _rules(body: _Body, found: set[str]) -> Iterator[Rule]:
    """Each missing node, the nodes it follows from, its positions (T, 3); later rules use earlier ones."""
    yield from (rule for rule in _trunk(body, found) if rule[0] not in found)
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        yield from (rule for rule in _limbs(body, found, side, sign) if rule[0] not in found)


def _trunk(body: _Body, found: set[str]) -> Iterator[Rule]:
    yield "hip_center", _HIPS, 0.5 * (body["hip_left"] + body["hip_right"])
    if {"shoulder_left", "shoulder_right"} <= found:
        shoulders = ("shoulder_left", "shoulder_right")
        yield "shoulder_center", shoulders, 0.5 * (body[shoulders[0]] + body[shoulders[1]])
    else:
        trunk = TRUNK * body.stature * unit(body["spine"] - body["hip_center"])
        yield "shoulder_center", ("hip_center", "spine"), body["hip_center"] + trunk
    yield "spine", _ENDS, body["hip_center"] + (body["shoulder_center"] - body["hip_center"]) / 3.0
    yield "head", _ENDS, body["shoulder_center"] + HEAD * body.stature * body.up


def _limbs(body: _Body, found: set[str], side: str, sign: float) -> Iterator[Rule]:
    stature = body.stature
    shoulder, elbow, wrist, hand = (f"{joint}_{side}" for joint in ("shoulder", "elbow", "wrist", "hand"))
    out = sign * HALF_SHOULDERS * stature * body.left
    yield shoulder, (*_ENDS, *_HIPS), body["shoulder_center"] + out
    if wrist in found:
        yield elbow, (shoulder, wrist), 0.5 * (body[shoulder] + body[wrist])
    else:
        yield elbow, (shoulder, *_ENDS), body[shoulder] - UPPER_ARM * stature * body.up
    yield wrist, (elbow, *_ENDS), body[elbow] - FOREARM * stature * body.up
    yield hand, (wrist, elbow), body[wrist] + HAND * unit(body[wrist] - body[elbow])
    foot, ankle, knee = (f"{joint}_{side}" for joint in ("foot", "ankle", "knee"))
    ahead = unit(perpendicular(np.cross(body.left, body.up), unit(body[ankle] - body[knee])))
    yield foot, (ankle, knee, *_ENDS, *_HIPS), body[ankle] + FOOT * stature * ahead
