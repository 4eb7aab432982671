"""Reliability of the parts of a recording, decided by measurement, not by file format.

A depth sensor sees the hip line badly (its yaw is off by 15 to 43 degrees in an oblique view) and the feet
worse. Parts that do not repeat from stride to stride, or change their length, are replaced by a neutral pose.
An optical recording passes every test and keeps all its measurements.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.body_points import place
from kinemimic.pipeline.kinematics.orientation.from_positions import FOOT_DROP, node_frames
from kinemimic.pipeline.kinematics.rotations import conjugate, from_axis_angle, multiply, to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.locomotion.leg_pose import leg_bones
from kinemimic.pipeline.locomotion.phase import fourier
from kinemimic.retarget.strides.loop import PooledFrames, mean_rotation

MAX_BONE_SPREAD = 0.025  # spread of a leg bone over its length; below it, the recording is precise
MAX_WIDTH_SPREAD = 0.05  # of the hip and shoulder lines
MAX_RESIDUAL = np.radians(4.0)  # rms about the segment's own loop
MIN_SLOPE = 0.3  # sine of the angle between a leg and the heading, from which both define a plane
MAX_FOOT_PITCH = np.radians(20.0)  # of a foot in contact, from flat
MAX_EXTENSION = np.radians(28.0)  # of a hip: the humanoid's limit of 30, with a margin
MAX_PITCH_FROM_TRUNK = np.radians(15.0)
THIGH_HARMONICS = 5
FOOT_FLAT = (0.12, 0.35)  # phases after the foot is farthest ahead in which it is flat


@dataclass(frozen=True)
class SensorReliability:
    """Which measurements of a recording are used; the others are replaced by a neutral pose.

    precise: the legs are accurate to a centimetre: their bones keep their length and the pelvis repeats (a
        depth sensor's recording stored as angles has constant bones too)
    pelvis, torso, feet: measured (True) or neutral
    lean: radians, median pitch of the trunk, given to a neutral torso
    pitch: radians, of a neutral pelvis: the lean, and farther forward as far as the thighs' extension needs
    flat_feet: the feet are tracked, and flat where they stand, as a depth sensor's never are
    foot_pitch: (2,) radians, pitch of the left and right sole in contact, to be subtracted
    measured: the numbers behind the decisions
    """

    precise: bool
    pelvis: bool
    torso: bool
    feet: bool
    lean: float
    foot_pitch: tuple[float, float]
    measured: dict[str, float]
    pitch: float = 0.0
    flat_feet: bool = False

    def shows_width(self, rigid: bool) -> bool:
        """Whether the recording shows how far apart the ankles are; rigid: whether bones keep their length.

        The trunk of an unsteady walk does not repeat; its feet still show it.
        """
        return self.precise or (rigid and self.flat_feet)


def assess_reliability(strides: PooledFrames) -> SensorReliability:
    """The reliability of pooled strides, from their repeatability and bone lengths."""
    p, phase = strides.positions, strides.phase
    frames = node_frames(p)
    bones = leg_bones(p)
    rigidity = float(np.max(np.nanstd(bones, axis=0) / np.nanmean(bones, axis=0)))
    measured = {"leg_bone_spread": rigidity}
    steady: dict[str, bool] = {}
    for name, node, line in (("pelvis", "hip_center", "hip"), ("torso", "spine", "shoulder")):
        width = np.linalg.norm(p[:, N[f"{line}_left"]] - p[:, N[f"{line}_right"]], axis=-1)
        seen = width[np.isfinite(width)]
        # A line that was never seen, such as the shoulders in a recording of legs, is not steady.
        spread = float(np.std(seen) / np.mean(seen)) if len(seen) else float("inf")
        residual = _residual(phase, frames[:, N[node]])
        measured |= {f"{line}_width_spread": spread, f"{name}_residual_deg": float(np.degrees(residual))}
        steady[name] = bool(spread < MAX_WIDTH_SPREAD and residual < MAX_RESIDUAL)
    # Not from the pelvis: its short line from hip centre to spine is off by tens of degrees.
    trunk = p[:, N["shoulder_center"]] - place(p, "hips")
    leans = np.arctan2(trunk[:, 0], trunk[:, 2])
    leans = leans[np.isfinite(leans)]
    lean = float(np.median(leans)) if len(leans) else 0.0
    pitches = []
    for side, shift in (("left", 0.0), ("right", 0.5)):
        toe = p[:, N[f"foot_{side}"]] - p[:, N[f"ankle_{side}"]]
        pitch = np.arctan2(-toe[:, 2], toe[:, 0]) - FOOT_DROP
        stance = np.mod(phase + shift, 1.0)
        planted = (stance > FOOT_FLAT[0]) & (stance < FOOT_FLAT[1]) & np.isfinite(pitch)
        pitches.append(float(np.median(pitch[planted])) if planted.any() else np.pi)
    measured |= {
        "trunk_lean_deg": float(np.degrees(lean)),
        "planted_foot_pitch_deg": float(np.degrees(np.mean(pitches))),
    }
    pelvis_pitch = _pelvis_pitch(strides, lean)
    measured["pelvis_pitch_deg"] = float(np.degrees(pelvis_pitch))
    precise = rigidity < MAX_BONE_SPREAD and steady["pelvis"]
    flat_feet = tracks_feet(strides.weights) and bool(np.max(np.abs(pitches)) < MAX_FOOT_PITCH)
    return SensorReliability(
        precise=precise,
        pelvis=steady["pelvis"],
        torso=steady["torso"],
        feet=precise and flat_feet,
        lean=lean,
        foot_pitch=(pitches[0], pitches[1]),
        measured=measured,
        pitch=pelvis_pitch,
        flat_feet=flat_feet,
    )


def tracks_feet(weights: Array) -> bool:
    """Whether both feet are tracked in some of the frames with weights (M, 20), 1 for a tracked node. A
    derived foot, at a right angle to the shank, never is."""
    return bool((weights[:, [N["foot_left"], N["foot_right"]]] >= 1.0).any(axis=0).all())


def _pelvis_pitch(strides: PooledFrames, lean: float) -> float:
    """Pitch in radians of a neutral pelvis: the lean of the trunk, but such that both hips extend within
    their range.

    The trunk's line, from between the hips to between the shoulders, leans back where the sensor has the hips
    in front of their place: a pelvis with that lean would extend the hips farther than people can.
    """
    at = np.arange(60) / 60.0
    back = []
    for side in SIDES:
        thigh = strides.positions[:, N[f"knee_{side}"]] - strides.positions[:, N[f"hip_{side}"]]
        angle = np.arctan2(thigh[:, 0], -thigh[:, 2])
        seen = np.isfinite(angle) & (strides.weights[:, N[f"knee_{side}"]] > 0)
        if seen.sum() > 4 * THIGH_HARMONICS:
            curve = fourier.fit(strides.phase[seen], angle[seen, None], THIGH_HARMONICS)
            back.append(float(fourier.evaluate(curve, at).min()))
    if not back:
        return lean
    return float(np.clip(-MAX_EXTENSION - min(back), lean, lean + MAX_PITCH_FROM_TRUNK))


def reliable_frames(positions: Array, reliability: SensorReliability, heading: Array | float = 0.0) -> Array:
    """World frames (M, 20, 4) of nodes at positions (M, 20, 3), neutral where unreliable.

    heading: radians from +X, (M,) or one for all. A neutral pelvis or trunk is along +X.
    """
    pelvis, torso = (
        np.broadcast_to(from_axis_angle("Y", angle), (len(positions), 4))
        for angle in (reliability.pitch, reliability.lean)
    )
    points = positions if reliability.precise else knees_in_sagittal_plane(positions, heading)
    frames = node_frames(
        points, pelvis=None if reliability.pelvis else pelvis, torso=None if reliability.torso else torso
    )
    for side, pitch in zip(SIDES, reliability.foot_pitch, strict=True):
        ankle, knee = N[f"ankle_{side}"], N[f"knee_{side}"]
        if reliability.feet:
            frames[:, ankle] = multiply(frames[:, ankle], from_axis_angle("Y", -pitch))
        else:
            frames[:, ankle] = frames[:, knee]
    return frames


def knees_in_sagittal_plane(positions: Array, heading: Array | float = 0.0) -> Array:
    """Positions (M, 20, 3) with each knee moved sideways into the plane of hip, ankle and heading, which is
    (M,) or one for all, radians from +X.

    The twist of a nearly straight leg is observable only at centimetre accuracy; otherwise it is noise of 30
    degrees, which would swing the feet.
    """
    out = positions.copy()
    ahead, left = (
        np.stack(np.broadcast_arrays(np.cos(turned), np.sin(turned), 0.0), axis=-1)
        for turned in (heading, heading + 0.5 * np.pi)
    )
    for side in SIDES:
        hip, knee, ankle = (positions[:, N[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle"))
        leg = ankle - hip
        length = np.linalg.norm(leg, axis=-1, keepdims=True)
        normal = np.cross(leg, ahead)
        size = np.linalg.norm(normal, axis=-1, keepdims=True)
        # The leg of a person who lies is along the heading: the plane across the body's left then.
        flat = size < MIN_SLOPE * length
        level = leg / np.where(flat, length, 1.0)
        across = left - np.sum(left * level, axis=-1, keepdims=True) * level
        normal = np.where(flat, across, normal)
        normal /= np.where(flat, np.linalg.norm(across, axis=-1, keepdims=True), size)
        aside = np.sum((knee - hip) * normal, axis=-1, keepdims=True)
        out[:, N[f"knee_{side}"]] = knee - aside * normal
    return out


def _residual(phase: Array, frames: Array) -> float:
    """Root mean square angle (radians) of world frames (M, 4) about their own loop of four harmonics."""
    seen = np.isfinite(frames).all(axis=-1)
    if seen.sum() < 12:
        return float("inf")
    q = frames[seen]
    turns = to_rotvec(multiply(conjugate(mean_rotation(q, np.ones(len(q)))), q))
    residuals = turns - fourier.evaluate(fourier.fit(phase[seen], turns, 4), phase[seen])
    return float(np.sqrt(np.mean(np.sum(residuals**2, axis=-1))))
