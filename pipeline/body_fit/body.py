"""The body that is fitted: 13 rigid segments, ball joints and hinges, lengths in proportion to the height.

Axes of every segment at rest, standing with the arms down: X forward, Y left, Z up. A segment's origin is the
joint at which it turns. Lengths are products of the height, the proportions of an average adult (Drillis and
Contini, as in Winter, Biomechanics and Motor Control of Human Movement) and factors close to 1, which the fit
finds. Left and right are equally long.

`ankle` is the centre of the joint; `instep` is where a network sees it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array

MEAN_HEIGHT = 1.70
"""Metres, of a person whose height is not given: angles do not depend on it."""

# Lengths that the fit finds, as shares of the height, and the standard deviation of their factors.
LENGTHS: dict[str, tuple[float, float]] = {
    "pelvis": (0.115, 0.10),  # between the hip joints
    "thigh": (0.242, 0.03),
    "shank": (0.243, 0.03),
    "foot": (0.120, 0.08),  # ankle to toe, along the sole
    "ankle": (0.039, 0.10),  # of the ankle above the sole
    "trunk": (0.305, 0.05),  # middle of the hips to the middle of the shoulders
    "shoulders": (0.225, 0.08),  # between the shoulder joints
    "upper_arm": (0.175, 0.05),
    "forearm": (0.150, 0.05),
    "head": (0.130, 0.10),  # middle of the shoulders to the middle of the ears
}
LENGTH_NAMES: tuple[str, ...] = tuple(LENGTHS)
# The lengths which the height fixes together.
STATURE: tuple[str, ...] = ("thigh", "shank", "trunk")
# The trunk bends at this share of its length.
LUMBAR = 0.25
# Where networks that were trained on people's clicks see an ankle, in lengths of the shank in front of and
# above the joint's centre: on the skin, 2 cm and 1 cm. Both clips with an optical truth show it.
INSTEP = (0.048, 0.024)


@dataclass(frozen=True)
class Segment:
    """name; parent: index, -1 for the pelvis; hinge: the axis (3,) of a hinge, or None for a ball joint;
    offset: length -> coefficients (3,) of the joint's place in the parent's frame."""

    name: str
    parent: int
    hinge: tuple[float, float, float] | None
    offset: dict[str, tuple[float, float, float]]


@dataclass(frozen=True)
class Point:
    """A point of a segment; offset: length -> coefficients (3,) of its place in the segment's frame."""

    name: str
    segment: int
    offset: dict[str, tuple[float, float, float]]


def kind_of(name: str) -> str:
    """A name of a segment or a point without the side."""
    return name.removesuffix("_left").removesuffix("_right")


_KNEE, _ELBOW = (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)
_DOWN = (0.0, 0.0, -1.0)


def _segments() -> tuple[Segment, ...]:
    trunk = Segment("trunk", 0, None, {"trunk": (0.0, 0.0, LUMBAR)})
    head = Segment("head", 1, None, {"trunk": (0.0, 0.0, 1.0 - LUMBAR)})
    found = [Segment("pelvis", -1, None, {}), trunk, head]
    for side, sign in (("left", 0.5), ("right", -0.5)):
        k = len(found)
        found += [
            Segment(f"thigh_{side}", 0, None, {"pelvis": (0.0, sign, 0.0)}),
            Segment(f"shank_{side}", k, _KNEE, {"thigh": _DOWN}),
            Segment(f"foot_{side}", k + 1, None, {"shank": _DOWN}),
        ]
    for side, sign in (("left", 0.5), ("right", -0.5)):
        k = len(found)
        shoulder = {"trunk": (0.0, 0.0, 1.0 - LUMBAR), "shoulders": (0.0, sign, 0.0)}
        found += [
            Segment(f"upper_arm_{side}", 1, None, shoulder),
            Segment(f"forearm_{side}", k, _ELBOW, {"upper_arm": _DOWN}),
        ]
    return tuple(found)


SEGMENTS: tuple[Segment, ...] = _segments()
SEGMENT_INDEX: dict[str, int] = {segment.name: index for index, segment in enumerate(SEGMENTS)}


def _points() -> tuple[Point, ...]:
    at = SEGMENT_INDEX
    found = [
        Point("hip_center", at["pelvis"], {}),
        Point("spine", at["trunk"], {"trunk": (0.0, 0.0, 0.10)}),
        Point("shoulder_center", at["head"], {}),
        Point("head", at["head"], {"head": (0.0, 0.0, 1.0)}),
        Point("nose", at["head"], {"head": (0.45, 0.0, 0.85)}),
    ]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        thigh, shank, foot = (at[f"{name}_{side}"] for name in ("thigh", "shank", "foot"))
        arm, forearm = at[f"upper_arm_{side}"], at[f"forearm_{side}"]
        found += [
            Point(f"ear_{side}", at["head"], {"head": (0.0, 0.33 * sign, 1.0)}),
            Point(f"shoulder_{side}", arm, {}),
            Point(f"elbow_{side}", forearm, {}),
            Point(f"wrist_{side}", forearm, {"forearm": _DOWN}),
            Point(f"hand_{side}", forearm, {"forearm": (0.0, 0.0, -1.3)}),
            Point(f"hip_{side}", thigh, {}),
            Point(f"knee_{side}", shank, {}),
            Point(f"ankle_{side}", foot, {}),
            Point(f"instep_{side}", shank, {"shank": (INSTEP[0], 0.0, INSTEP[1] - 1.0)}),
            Point(f"heel_{side}", foot, {"foot": (-0.27, 0.0, 0.0), "ankle": _DOWN}),
            Point(f"foot_{side}", foot, {"foot": (1.0, 0.0, 0.0), "ankle": _DOWN}),
        ]
    return tuple(found)


POINTS: tuple[Point, ...] = _points()
POINT_INDEX: dict[str, int] = {point.name: index for index, point in enumerate(POINTS)}


def coefficients(offsets: tuple[dict[str, tuple[float, float, float]], ...]) -> Array:
    """(N, L, 3): metres per height and factor of each length, for offsets of segments or points."""
    result = np.zeros((len(offsets), len(LENGTHS), 3))
    for row, offset in enumerate(offsets):
        for name, vector in offset.items():
            result[row, LENGTH_NAMES.index(name)] = LENGTHS[name][0] * np.array(vector)
    return result


SEGMENT_OFFSETS: Array = coefficients(tuple(segment.offset for segment in SEGMENTS))
POINT_OFFSETS: Array = coefficients(tuple(point.offset for point in POINTS))


@dataclass(frozen=True)
class Unknowns:
    """Columns of a frame's unknowns: three of the place of the pelvis, then those of every joint.

    count: their number K; first: column of each segment's first; width: 3 for a ball joint, 1 for a hinge.
    """

    count: int
    first: tuple[int, ...]
    width: tuple[int, ...]

    def columns(self, segment: int) -> slice:
        """Columns of a segment's joint."""
        return slice(self.first[segment], self.first[segment] + self.width[segment])


def _unknowns() -> Unknowns:
    width = tuple(3 if segment.hinge is None else 1 for segment in SEGMENTS)
    first = tuple(3 + sum(width[:k]) for k in range(len(width)))
    return Unknowns(3 + sum(width), first, width)


UNKNOWNS: Unknowns = _unknowns()


def _moves() -> NDArray[np.bool_]:
    """(S, S): whether a segment moves when the joint of another (column) turns."""
    moves = np.eye(len(SEGMENTS), dtype=bool)
    for k, segment in enumerate(SEGMENTS):
        if segment.parent >= 0:
            moves[k] |= moves[segment.parent]
    return moves


MOVES: NDArray[np.bool_] = _moves()
