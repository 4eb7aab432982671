"""Errors of a Kinect v1's joints, at levels measured on real recordings.

Each function models one error. Lengths are metres; "lateral" is across the line of sight. Levels come from
real v1 recordings of walking: white noise from third differences, states by counting.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask, States
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, NODE_INDEX, NODES, SIDES, TRACKED
from kinemimic.pipeline.virtual_kinect.camera import TRUNK, Camera, occluded

# Lateral white noise that is independent per joint, at the reference distance, in mm.
_OWN_MM: dict[str, float] = {
    "hip_center": 2.0,
    "spine": 2.0,
    "shoulder_center": 4.0,
    "head": 6.0,
    "shoulder": 6.0,
    "elbow": 6.0,
    "wrist": 5.0,
    "hand": 6.0,
    "hip": 4.0,
    "knee": 6.0,
    "ankle": 3.0,
    "foot": 5.0,
}
# Noise that joints share, in mm: the sensor fits one model to the trunk (hip centre, spine and hips scatter
# by 8 mm, but by only 2 to 5 mm relative to each other), and a hand or foot follows its wrist or ankle.
_SHARED_MM: tuple[tuple[float, tuple[str, ...]], ...] = (
    (6.5, ("hip_center", "spine", "hip_left", "hip_right")),
    (12.0, ("wrist_left", "hand_left")),
    (12.0, ("wrist_right", "hand_right")),
    (5.0, ("ankle_left", "foot_left")),
    (5.0, ("ankle_right", "foot_right")),
)
_OWN: Array = np.array([1e-3 * _OWN_MM[node.removesuffix("_left").removesuffix("_right")] for node in NODES])
# (20, 5): the shared noise of each joint, one column per group.
_SHARED: Array = np.array([[1e-3 * mm * (node in group) for mm, group in _SHARED_MM] for node in NODES])
_LEG = ("knee", "ankle", "foot")


@dataclass(frozen=True)
class NoiseLevels:
    """Levels of all errors.

    White noise, states, hip width, feet and clock match real v1 walks. Slow errors cannot be separated from
    the gait without a second sensor, so bias, inferred, hip_yaw and swap are chosen such that low-passed
    knees are about 5 degrees off, close to the pass-to-pass differences of real walks.

    distance: metres at which the noise has its nominal level; it grows with the distance squared. depth:
    ratio of noise along the line of sight to lateral noise. white: factor on the white noise. bias: slow
    error relative to white noise; bias_time: its correlation time, seconds. hip_width: measured over true
    width of the hips; hip_yaw: share of the angle between heading and line of sight by which the hip line
    turns towards the sensor; hip_yaw_limit: radians. foot_drop: radians by which measured feet point too far
    down. flicker: probability per frame that a visible joint becomes inferred; flicker_stay: that it stays
    so. inferred: lateral error of an inferred joint, metres, with the correlation time inferred_time,
    seconds. lost: probability that an inferred joint is not reported in a frame. crossing: pixels between the
    knees below which the legs may be swapped; swap: probability per such frame; swap_frames: shortest and
    longest swap. edge_frames: shortest and longest disturbance as the subject enters or leaves; edge: error
    of knees and ankles then, metres.
    """

    distance: float = 2.7
    depth: float = 1.5
    white: float = 1.0
    bias: float = 0.5
    bias_time: float = 1.0
    hip_width: float = 0.6
    hip_yaw: float = 0.25
    hip_yaw_limit: float = np.radians(25.0)
    foot_drop: float = np.radians(27.0)
    flicker: float = 0.02
    flicker_stay: float = 0.65
    inferred: float = 0.015
    inferred_time: float = 0.3
    lost: float = 0.03
    crossing: float = 6.0
    swap: float = 0.04
    swap_frames: tuple[int, int] = (1, 3)
    edge_frames: tuple[int, int] = (2, 5)
    edge: float = 0.12


@dataclass(frozen=True)
class Observation:
    """The sensor's report: positions (T, 20, 3), NaN where lost; states (T, 20); swapped (T,): legs
    swapped."""

    positions: Array
    states: States
    swapped: Mask


def observe(
    joints: Array, heading: Array, times: Array, camera: Camera, levels: NoiseLevels, rng: np.random.Generator
) -> Observation:
    """One pass as the sensor reports it: true joints (T, 20, 3), heading (T,) in radians, times (T,) in
    seconds."""
    not_visible = occluded(camera, joints)
    seen = _drop_feet(_narrow_hips(joints, heading, camera, levels), levels)
    error = _white(len(times), levels, rng) + _slow(times, levels, rng)
    inferred = not_visible | _flicker(not_visible.shape, levels, rng)
    inferred[:, TRUNK] = False
    error += np.where(inferred[..., None], _inferred_error(times, levels, rng), 0.0)
    seen = seen + _stretched(error, joints, camera, levels)
    states = np.where(inferred, INFERRED, TRACKED).astype(np.uint8)
    _disturb_edges(seen, states, levels, rng)
    swapped = _swap_legs(seen, states, joints, camera, levels, rng)
    lost = inferred & (rng.random(inferred.shape) < levels.lost)
    seen[lost], states[lost] = np.nan, MISSING
    return Observation(seen, states, swapped)


def _scaled(own: Array, shared: Array) -> Array:
    """Noise of unit variance, independent (T, 20, 3) and of the groups (T, 5, 3), scaled to the joints'
    levels."""
    return np.asarray(own * _OWN[:, None] + _SHARED @ shared)


def _white(frames: int, levels: NoiseLevels, rng: np.random.Generator) -> Array:
    own, shared = (rng.standard_normal((frames, count, 3)) for count in _SHARED.shape)
    return levels.white * _scaled(own, shared)


def _slow(times: Array, levels: NoiseLevels, rng: np.random.Generator) -> Array:
    own, shared = (_wander(times, count, levels.bias_time, rng) for count in _SHARED.shape)
    return levels.bias * _scaled(own, shared)


def _inferred_error(times: Array, levels: NoiseLevels, rng: np.random.Generator) -> Array:
    """Error (T, 20, 3) of inferred joints; a hand or foot moves with its wrist or ankle."""
    drift = levels.inferred * _wander(times, len(NODES), levels.inferred_time, rng)
    for _, (leader, follower) in _SHARED_MM[1:]:
        drift[:, NODE_INDEX[follower]] = drift[:, NODE_INDEX[leader]]
    return drift


def _wander(times: Array, joints: int, correlation: float, rng: np.random.Generator) -> Array:
    """Ornstein-Uhlenbeck noise (T, joints, 3) of unit variance with a correlation time in seconds."""
    noise = rng.standard_normal((len(times), joints, 3))
    for frame in range(1, len(times)):
        decay = np.exp(-(times[frame] - times[frame - 1]) / correlation)
        noise[frame] = decay * noise[frame - 1] + np.sqrt(1.0 - decay * decay) * noise[frame]
    return noise


def _stretched(error: Array, joints: Array, camera: Camera, levels: NoiseLevels) -> Array:
    """Isotropic errors (T, 20, 3), scaled with the distance squared and stretched along the line of sight."""
    sight = joints - camera.position
    distance = np.linalg.norm(sight, axis=-1, keepdims=True)
    sight = sight / distance
    stretched = error + (levels.depth - 1.0) * np.sum(error * sight, axis=-1, keepdims=True) * sight
    return np.asarray((distance / levels.distance) ** 2 * stretched)


def _narrow_hips(joints: Array, heading: Array, camera: Camera, levels: NoiseLevels) -> Array:
    """Hips too close together, and their line turned towards the sensor in an oblique view."""
    left, right = NODE_INDEX["hip_left"], NODE_INDEX["hip_right"]
    middle = 0.5 * (joints[:, left] + joints[:, right])
    sight = camera.position - middle
    view_angle = np.arctan2(sight[:, 1], sight[:, 0]) - heading
    view_angle = np.arctan2(np.sin(view_angle), np.cos(view_angle))
    yaw = np.clip(levels.hip_yaw * view_angle, -levels.hip_yaw_limit, levels.hip_yaw_limit)
    half = rotate(from_axis_angle("Z", yaw), 0.5 * levels.hip_width * (joints[:, left] - joints[:, right]))
    seen = joints.copy()
    seen[:, left], seen[:, right] = middle + half, middle - half
    return seen


def _drop_feet(joints: Array, levels: NoiseLevels) -> Array:
    """Feet that point down even in stance (42 to 62 degrees in real recordings)."""
    for side in SIDES:
        ankle, foot = NODE_INDEX[f"ankle_{side}"], NODE_INDEX[f"foot_{side}"]
        sole = joints[:, foot] - joints[:, ankle]
        flat = np.hypot(sole[:, 0], sole[:, 1])
        # Limited before the vertical: a foot that already points down stays.
        pitch = np.minimum(np.arctan2(-sole[:, 2], flat) + levels.foot_drop, np.radians(80.0))
        length = np.linalg.norm(sole, axis=-1)
        ahead = sole[:, :2] / np.maximum(flat, 1e-9)[:, None]
        joints[:, foot, :2] = joints[:, ankle, :2] + (length * np.cos(pitch))[:, None] * ahead
        joints[:, foot, 2] = joints[:, ankle, 2] - length * np.sin(pitch)
    return joints


def _flicker(shape: tuple[int, int], levels: NoiseLevels, rng: np.random.Generator) -> Mask:
    """Visible joints that become inferred for a few frames: a two-state Markov chain per joint."""
    draws = rng.random(shape)
    inferred = np.zeros(shape, dtype=np.bool_)
    for frame in range(1, shape[0]):
        inferred[frame] = draws[frame] < np.where(inferred[frame - 1], levels.flicker_stay, levels.flicker)
    return inferred


def _disturb_edges(seen: Array, states: States, levels: NoiseLevels, rng: np.random.Generator) -> None:
    """Disturb the legs as the subject enters and leaves, when the sensor has not found them or loses them."""
    counts = rng.integers(levels.edge_frames[0], levels.edge_frames[1] + 1, size=2)
    edges = np.r_[np.arange(counts[0]), np.arange(len(seen) - counts[1], len(seen))]
    for side in SIDES:
        knee, ankle, foot = (NODE_INDEX[f"{kind}_{side}"] for kind in _LEG)
        error = levels.edge * rng.standard_normal((len(edges), 2, 3))
        for number, joint in ((0, knee), (1, ankle), (1, foot)):
            seen[edges, joint] += error[:, number]
            guessed = edges[rng.random(len(edges)) < 0.5]
            states[guessed, joint] = np.minimum(states[guessed, joint], INFERRED)


def _swap_legs(
    seen: Array, states: States, joints: Array, camera: Camera, levels: NoiseLevels, rng: np.random.Generator
) -> Mask:
    """Swap left and right legs for a few frames where they cross in the image."""
    pixels, _ = camera.project(joints)
    gap = np.abs(pixels[:, NODE_INDEX["knee_left"], 0] - pixels[:, NODE_INDEX["knee_right"], 0])
    starts = (gap < levels.crossing) & (rng.random(len(seen)) < levels.swap)
    lengths = rng.integers(levels.swap_frames[0], levels.swap_frames[1] + 1, size=len(seen))
    swapped = np.zeros(len(seen), dtype=np.bool_)
    for frame in np.flatnonzero(starts):
        swapped[frame : frame + lengths[frame]] = True
    left = [NODE_INDEX[f"{kind}_left"] for kind in _LEG]
    right = [NODE_INDEX[f"{kind}_right"] for kind in _LEG]
    rows = np.flatnonzero(swapped)[:, None]
    for array in (seen, states):
        array[rows, left + right] = array[rows, right + left]
    return swapped
