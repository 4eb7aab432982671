"""The pose of a live capture on the Table 1 body: the closed form of `retarget`, over the recent past.

Every moment comes with a window of positions around it. All of it is retargeted, so that twists are carried
over and velocities come from both sides, and the row of the moment is kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.kinematics.orientation.from_positions import FOOT_DROP, local_rotations, node_frames
from kinemimic.pipeline.kinematics.orientation.trunk import pelvis_frames, torso_frames
from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    continuous,
    from_axis_angle,
    multiply,
    normalize,
    rotate,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES, SIDES
from kinemimic.pipeline.kinematics.spans import all_finite
from kinemimic.pipeline.live.capture import Moment
from kinemimic.pipeline.locomotion.path.heading import along_heading, body_heading
from kinemimic.retarget.feet.legs import limit_knee_extension
from kinemimic.retarget.feet.scale import abduct, body_kinematics, body_width
from kinemimic.retarget.humanoid.body import LEG_LENGTH
from kinemimic.retarget.live.ankles import with_neutral_ankles
from kinemimic.retarget.live.reliability import LiveReliability
from kinemimic.retarget.strides.sensor_reliability import MAX_FOOT_PITCH, knees_in_sagittal_plane

MIN_AMPLITUDE = 0.10  # m between the ankles, along the heading: a person who stands does not step
LEAN_TIME = 0.5  # s over which the lean of the trunk is averaged, beyond the window itself
PITCH_TIME = 3.0  # s over which the pitch of planted feet is averaged
_MAX_TURN = 6.0  # rad/s of the heading; faster, it is a flip
_ANOTHER = 0.4  # s without a person, after which another may have come
_PLANTED = 0.35  # m/s of an ankle over the ground


@dataclass(frozen=True)
class PoseWindow:
    """The window of a moment on the body.

    rotations: (M, 20, 4) local, the pelvis' in the world; positions, frames: (M, 20, 3), (M, 20, 4) of the
    body's nodes with its root at the origin; now: the row of the moment; heading: (M,) rad; hips: (M, 3) m,
    their recorded middle, and ankles: (M, 2) m, recorded heights of the ankles, both at the body's scale;
    strides: whether the ankles are apart in turns.
    """

    rotations: Array
    positions: Array
    frames: Array
    now: int
    heading: Array
    hips: Array
    ankles: Array
    strides: bool


class LivePose:
    """Retargets moments of one capture; it keeps what only time shows: reliability, lean, width of stance."""

    def __init__(self, rate: float) -> None:
        self.reliability = LiveReliability(rate)
        self._rate = rate
        self._lean = 0.0
        self._pitch = np.zeros(2)
        self._abduction = 0.0
        self._heading: float | None = None
        self._held = np.tile(IDENTITY, (len(NODES), 1))
        self._begun = False

    @property
    def scale(self) -> float:
        """The body's legs over the person's."""
        thighs, shanks = self.reliability.bones[[0, 2]], self.reliability.bones[[1, 3]]
        return float(LEG_LENGTH / np.nanmean(thighs + shanks))

    def window(self, moment: Moment) -> PoseWindow:
        """The pose around a moment that shows a person, from the first row of its window that does."""
        p, now = _since_seen(moment, self._rate)
        filled = _without_gaps(p)
        heading = self._followed(body_heading(filled, self._rate)[0], now)
        ahead = rotate(from_axis_angle("Z", -heading)[:, None], filled)
        apart = ahead[:, N["ankle_right"], 0] - ahead[:, N["ankle_left"], 0]
        walking = bool(np.sqrt(2.0) * np.std(apart) > MIN_AMPLITUDE)
        self.reliability.update(p, now, walking=walking)
        self._average_lean(ahead)
        frames = self._frames(ahead)
        feet = self._feet_are_seen(ahead, filled, now)
        if feet:
            for k, side in enumerate(SIDES):
                ankle = N[f"ankle_{side}"]
                frames[:, ankle] = multiply(frames[:, ankle], from_axis_angle("Y", -self._pitch[k]))
        else:
            for side in SIDES:
                frames[:, N[f"ankle_{side}"]] = frames[:, N[f"knee_{side}"]]
        rotations = self._without_missing(local_rotations(frames), now)
        if not self.reliability.precise:
            rotations = limit_knee_extension(rotations)
        rotations = abduct(rotations, self._abduction)
        rotations[:, 0] = multiply(from_axis_angle("Z", heading), rotations[:, 0])
        positions, world = body_kinematics(rotations)
        heights = self.scale * filled[:, [N["ankle_left"], N["ankle_right"]], 2]
        if not feet:
            rotations = with_neutral_ankles(rotations, world, heights, self._rate)
            positions, world = body_kinematics(rotations)
        if walking:
            self._widen(along_heading(positions, heading), ahead, now)
        rotations = continuous(rotations)
        hips = 0.5 * self.scale * (filled[:, N["hip_left"]] + filled[:, N["hip_right"]])
        return PoseWindow(rotations, positions, world, now, heading, hips, heights, walking)

    def _followed(self, heading: Array, now: int) -> Array:
        """The heading (M,) in radians, continued from the moment before."""
        if self._heading is not None:
            heading = heading + 2.0 * np.pi * np.round((self._heading - heading[now]) / (2.0 * np.pi))
            most = _MAX_TURN / self._rate
            change = heading[now] - self._heading
            # The whole window turns with it: the pose stays as it is relative to the heading.
            heading = heading + min(max(change, -most), most) - change
        self._heading = float(heading[now])
        return heading

    def _average_lean(self, ahead: Array) -> None:
        trunk = ahead[:, N["shoulder_center"]] - 0.5 * (ahead[:, N["hip_left"]] + ahead[:, N["hip_right"]])
        lean = np.arctan2(trunk[:, 0], trunk[:, 2])
        seen = lean[np.isfinite(lean)]
        if len(seen):
            # Over the strides of the window, and smoothly from moment to moment.
            change = float(np.median(seen)) - self._lean
            self._lean += change if not self._begun else change / (LEAN_TIME * self._rate)

    def _frames(self, ahead: Array) -> Array:
        """World frames (M, 20, 4) of the nodes, with X ahead; the trunk as far as it is reliable."""
        neutral = np.broadcast_to(from_axis_angle("Y", self._lean), (len(ahead), 4))
        points = ahead if self.reliability.precise else knees_in_sagittal_plane(ahead)
        torso = torso_frames(points)
        # A depth sensor's short line from hip centre to spine is off by tens of degrees.
        pelvis = pelvis_frames(points) if self.reliability.precise else torso
        return node_frames(
            points,
            pelvis=mixed(neutral, pelvis, self.reliability.pelvis),
            torso=mixed(neutral, torso, self.reliability.torso),
        )

    def _feet_are_seen(self, ahead: Array, filled: Array, now: int) -> bool:
        """Whether the feet are measured: flat on the ground where they stand, in a precise capture."""
        there = self.reliability.precise
        for k, side in enumerate(SIDES):
            ankle = filled[:, N[f"ankle_{side}"]]
            speed = self._rate * np.linalg.norm(np.gradient(ankle[:, :2], axis=0), axis=-1)
            low = ankle[:, 2] - ankle[:, 2].min() < 0.04
            toe = ahead[:, N[f"foot_{side}"]] - ahead[:, N[f"ankle_{side}"]]
            pitch = np.arctan2(-toe[:, 2], np.hypot(toe[:, 0], toe[:, 1])) - FOOT_DROP
            there &= bool(np.isfinite(pitch).any())
            planted: Mask = np.asarray((speed < _PLANTED) & low & np.isfinite(pitch), dtype=np.bool_)
            if not self._begun and planted.any():
                self._pitch[k] = float(np.median(pitch[planted]))
            elif planted[now]:
                self._pitch[k] += (float(pitch[now]) - self._pitch[k]) / (PITCH_TIME * self._rate)
        self._begun = True
        return there and bool(np.abs(self._pitch).max() < MAX_FOOT_PITCH)

    def _without_missing(self, rotations: Array, now: int) -> Array:
        """Local rotations (M, 20, 4), the pelvis' relative to the heading; those of unseen nodes are held as
        they were last seen."""
        missing = ~all_finite(rotations)
        if missing.any():
            rotations = np.where(missing[..., None], self._held[None], rotations)
        self._held = rotations[now]
        return rotations

    def _widen(self, body: Array, ahead: Array, now: int) -> None:
        """Turn the thighs so that the body's ankles are as far apart as the person's (`feet/scale.py`)."""
        left, right = N["ankle_left"], N["ankle_right"]
        person = self.scale * float(np.mean(ahead[: now + 1, left, 1] - ahead[: now + 1, right, 1]))
        wanted = body_width(person, precise=False)
        found = float(np.mean(body[: now + 1, left, 1] - body[: now + 1, right, 1]))
        change = (wanted - found) / (2.0 * LEG_LENGTH)
        self._abduction += change if self._abduction == 0.0 else change / (0.5 * self._rate)


def mixed(start: Array, end: Array, share: float) -> Array:
    """Rotations (..., 4) on the way from `start` to `end`; 0 is start."""
    if share >= 1.0:
        return end
    if share <= 0.0:
        return np.array(np.broadcast_to(start, end.shape))
    sign = np.where(np.sum(start * end, axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
    return normalize((1.0 - share) * start * sign + share * end)


def _since_seen(moment: Moment, rate: float) -> tuple[Array, int]:
    """Positions (M, 20, 3) from the first row with both legs on, and the row of the moment.

    Before a gap of both legs that is longer than `_ANOTHER`, somebody else may have been there.
    """
    legs = [N[f"{joint}_{side}"] for side in SIDES for joint in ("hip", "knee", "ankle")]
    seen = all_finite(moment.positions[: moment.now + 1, legs])
    both = np.flatnonzero(seen.all(axis=-1)).tolist()
    first = both[0] if both else 0
    for last, again in pairwise(both):
        # One leg that is hidden says nothing about who it is.
        if again - last > _ANOTHER * rate and not seen[last + 1 : again].any():
            first = again
    # Differences need two rows.
    first = max(0, min(first, len(moment.positions) - 3))
    return moment.positions[first:], moment.now - first


def _without_gaps(positions: Array) -> Array:
    """Positions (M, 20, 3) with gaps bridged linearly and ends held; a node that was never seen stays NaN."""
    missing = ~all_finite(positions)
    if not missing.any():
        return positions
    out, rows = positions.copy(), np.arange(len(positions))
    for node in np.flatnonzero(missing.any(axis=0)):
        seen = ~missing[:, node]
        if seen.any():
            for axis in range(3):
                out[:, node, axis] = np.interp(rows, rows[seen], positions[seen, node, axis])
    return out
