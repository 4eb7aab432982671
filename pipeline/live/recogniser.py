"""Axes, unit and layout of a live sender, from its first frames.

Nobody says how a stream is to be read: the number of joints gives the layout, the body which axis is up and
how long a unit is. A person who comes into view stands or walks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinemimic.pipeline.arrays import Array, States
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.proportions import complete, hip_narrowing, narrow_hips
from kinemimic.pipeline.kinematics.rotations import IDENTITY, Y_UP_TO_Z_UP, from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES, SIDES
from kinemimic.pipeline.kinematics.vectors import unit
from kinemimic.pipeline.live.frame import CapturedFrame
from kinemimic.pipeline.live.layouts import LAYOUTS
from kinemimic.pipeline.locomotion.leg_pose import leg_bones
from kinemimic.pipeline.quality.rules.length_units import UNITS, plausible_units
from kinemimic.pipeline.readers.kinect.azure_joints import WORLD_FROM_CAMERA
from kinemimic.pipeline.readers.landmarks.joint_sets import JointSet, fits, joint_set_of

# Nodes without which a frame says nothing about the walk.
_LEGS = [f"{joint}_{side}" for side in SIDES for joint in ("hip", "knee", "ankle")]
NEEDED = [N[name] for name in (*_LEGS, "shoulder_center")]
_UNLIKE = 1.8  # ratio of two bones of the legs, above which they are not a person's
_SAME_LEG = 0.15  # share by which legs of one person, or of two who are read alike, differ
FIRST = 10  # frames with both legs and a trunk, before anything is decided
# The upward direction in the sender's axes -> rotation to ours.
_TURNS: dict[tuple[int, int], Array] = {
    (2, 1): IDENTITY,
    (1, 1): Y_UP_TO_Z_UP,
    (1, -1): WORLD_FROM_CAMERA,
    (2, -1): from_axis_angle("X", np.pi),
    (0, 1): from_axis_angle("Y", -0.5 * np.pi),
    (0, -1): from_axis_angle("Y", 0.5 * np.pi),
}
UP_NAMES = {"z": (2, 1), "y": (1, 1), "-y": (1, -1), "-z": (2, -1), "x": (0, 1), "-x": (0, -1)}


@dataclass(frozen=True)
class Reading:
    """How a sender's frames become ours.

    turn: (4,) rotation to our axes; metres: of its unit; hips: factor on their distance; leg: m, thigh and
    shank.
    """

    layout: JointSet
    turn: Array
    metres: float
    unit: str
    up: str
    hips: float
    leg: float

    def nodes(self, frame: CapturedFrame) -> tuple[Array, States]:
        """Positions (20, 3) in metres, NaN where missing, and states (20,) of a frame of the same layout."""
        points, states = on_nodes(frame, self.layout)
        if self.hips != 1.0:
            narrow_hips(points, states, (N["hip_left"], N["hip_right"]), self.hips)
        return rotate(self.turn, self.metres * points), states


def on_nodes(frame: CapturedFrame, layout: JointSet) -> tuple[Array, States]:
    """Positions (20, 3) in the sender's axes and unit, NaN where missing, and states (20,)."""
    points, states = frame.arrays()
    positions = np.full((1, len(NODES), 3), np.nan)
    known = np.zeros((1, len(NODES)), dtype=np.uint8)
    for node, joints in layout.nodes.items():
        positions[0, N[node]], known[0, N[node]] = points[joints].mean(axis=0), states[joints].min()
    complete(positions, known, set(layout.nodes))
    hips, centre = [N["hip_left"], N["hip_right"]], N["hip_center"]
    if np.isnan(positions[0, centre]).any() and np.isfinite(positions[0, hips]).all():
        # Many pose networks have the pelvis at the origin, as senders have a joint that they do not see.
        positions[0, centre], known[0, centre] = positions[0, hips].mean(axis=0), known[0, hips].min()
    return positions[0], known[0]


def _ordered(expected: JointSet, points: Array) -> JointSet:
    """The set whose order the joints (T, J, 3) have: the expected one, unless another one alone fits them."""
    if fits(points, expected):
        return expected
    return joint_set_of(points) or expected


def _alike(one: float, other: float) -> bool:
    return abs(one - other) < _SAME_LEG * other


def _check_legs(layout: JointSet, bones: Array) -> None:
    """KinemimicError if thighs and shanks (4,) are not a person's: the joints are in another order.

    Both sides are alike, and a thigh is about as long as a shank.
    """
    pairs = bones[[[0, 2], [1, 3], [0, 1], [2, 3]]]
    if not (pairs.max(axis=1) <= _UNLIKE * pairs.min(axis=1)).all():
        lengths = ", ".join(f"{length:.3g}" for length in bones)
        raise KinemimicError(
            f"expected {len(layout.joints)} joints in the order of {layout.name}, found legs (thigh, shank, "
            f"left and right) of {lengths}"
        )


class Recogniser:
    """Decides how to read a sender from its first frames; `reading` is None until then.

    up: name of the axis that points up in the sender's axes ("y", "-y", "z", …), None to recognise it;
    before: how the sender was read before a pause. Its axes and unit are the same if the legs are as long.
    """

    def __init__(self, up: str | None = None, before: Reading | None = None) -> None:
        if up is not None and up not in UP_NAMES:
            raise KinemimicError(f"expected an axis among {', '.join(UP_NAMES)}, found {up!r:.20}")
        self.reading: Reading | None = None
        self._up, self._before = up, before
        self._layout: JointSet | None = None
        self._seen: list[CapturedFrame] = []

    def take(self, frame: CapturedFrame) -> bool:
        """Look at a frame; whether it can be read. KinemimicError for another number of joints."""
        layout = LAYOUTS[len(frame.positions)]
        if self._layout is None:
            self._layout = layout
        if layout is not self._layout:
            raise KinemimicError(
                f"expected frames of {len(self._layout.joints)} joints ({self._layout.name}) as before, "
                f"found {len(layout.joints)}; stop the other sender first"
            )
        if self.reading is None:
            positions, _ = on_nodes(frame, layout)
            if np.isfinite(positions[NEEDED]).all():
                self._seen.append(frame)
            if len(self._seen) >= FIRST:
                seen = self._seen
                self._seen = []
                self.reading = self._decided(layout, seen)
        return self.reading is not None

    def _decided(self, expected: JointSet, frames: Sequence[CapturedFrame]) -> Reading:
        layout = _ordered(expected, np.array([frame.arrays()[0] for frame in frames]))
        p = np.array([on_nodes(frame, layout)[0] for frame in frames])
        bones = np.nanmedian(leg_bones(p), axis=0)
        _check_legs(layout, bones)
        leg = 0.5 * float(bones.sum())
        possible = plausible_units(leg, UNITS)
        if not possible:
            raise KinemimicError(f"expected a leg of human length in {', '.join(UNITS)}, found {leg:.4g}")
        before = self._before
        if before is not None and layout is before.layout and _alike(leg * before.metres, before.leg):
            return replace(before, hips=hip_narrowing(p))
        hips, ankles = (
            0.5 * (p[:, N[f"{joint}_left"]] + p[:, N[f"{joint}_right"]]) for joint in ("hip", "ankle")
        )
        upward = np.nanmean(unit(p[:, N["shoulder_center"]] - hips) + unit(hips - ankles), axis=0)
        if self._up is not None:
            axis, sign = UP_NAMES[self._up]
        else:
            axis = int(np.argmax(np.abs(upward)))
            sign = 1 if upward[axis] > 0 else -1
        name = possible[0]
        up = next(spelt for spelt, known in UP_NAMES.items() if known == (axis, sign))
        return Reading(
            layout, _TURNS[axis, sign], UNITS[name], name.split()[0], up, hip_narrowing(p), leg * UNITS[name]
        )
