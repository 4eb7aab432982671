"""Axes, unit and layout of a live sender, from its first frames.

Nobody says how a stream is to be read: the number of joints gives the layout, the body which axis is up and
how long a unit is. A person who comes into view stands or walks.
"""

from __future__ import annotations

from dataclasses import dataclass

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
from kinemimic.pipeline.readers.landmarks.joint_sets import JointSet

# Nodes without which a frame says nothing about the walk.
_LEGS = [f"{joint}_{side}" for side in SIDES for joint in ("hip", "knee", "ankle")]
NEEDED = [N[name] for name in (*_LEGS, "shoulder_center")]
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

    turn: (4,) rotation to our axes; metres: of its unit; hips: factor on their distance.
    """

    layout: JointSet
    turn: Array
    metres: float
    unit: str
    up: str
    hips: float

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
    return positions[0], known[0]


class Recogniser:
    """Decides how to read a sender from its first frames; `reading` is None until then.

    up: name of the axis that points up in the sender's axes ("y", "-y", "z", …), None to recognise it.
    """

    def __init__(self, up: str | None = None) -> None:
        if up is not None and up not in UP_NAMES:
            raise KinemimicError(f"expected an axis among {', '.join(UP_NAMES)}, found {up!r:.20}")
        self.reading: Reading | None = None
        self._up = up
        self._layout: JointSet | None = None
        self._seen: list[Array] = []

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
                self._seen.append(positions)
            if len(self._seen) >= FIRST:
                seen = np.array(self._seen)
                self._seen.clear()
                self.reading = self._decided(layout, seen)
        return self.reading is not None

    def _decided(self, layout: JointSet, p: Array) -> Reading:
        bones = np.nanmedian(leg_bones(p), axis=0)
        leg = 0.5 * float(bones.sum())
        possible = plausible_units(leg, UNITS)
        if not possible:
            raise KinemimicError(f"expected a leg of human length in {', '.join(UNITS)}, found {leg:.4g}")
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
        return Reading(layout, _TURNS[axis, sign], UNITS[name], name.split()[0], up, hip_narrowing(p))
