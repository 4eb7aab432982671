"""A first pose for every frame, from the rough places of the points alone."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.body_fit.body import LENGTHS, POINT_INDEX, SEGMENTS
from kinemimic.pipeline.body_fit.camera import SceneCamera
from kinemimic.pipeline.body_fit.observed import Observed
from kinemimic.pipeline.body_fit.pose import Poses, place, rotation_of
from kinemimic.pipeline.kinematics.skeleton import SIDES

N = POINT_INDEX
# Seconds over which the distance from the camera, which is rough, is averaged.
_DISTANCE_SPAN = 0.15
# A joint that is straighter (the sine of its angle) has no plane of its own.
_STRAIGHT = 0.2
_FLOOR_PERCENTILE = 5.0
_LEGS = tuple(
    (f"{a}_{side}", f"{b}_{side}") for side in SIDES for a, b in (("hip", "knee"), ("knee", "instep"))
)


def rough_scale(observed: Observed, height: float) -> float:
    """Factor of the rough places at which thighs and shanks are as long as a person's of that height."""
    bones = (observed.world[:, N[a]] - observed.world[:, N[b]] for a, b in _LEGS)
    rough = sum(float(np.median(np.linalg.norm(bone, axis=-1))) for bone in bones)
    return height * 2.0 * (LENGTHS["thigh"][0] + LENGTHS["shank"][0]) / max(rough, 1e-3)


def rays(observed: Observed, camera: SceneCamera) -> Array:
    """(T, 3) unit vectors in the camera's axes from the camera to the middle of the hips in the image."""
    hips = (observed.pixels[:, N["hip_left"]] + observed.pixels[:, N["hip_right"]]) / 2.0
    ray = np.column_stack([(hips - np.array(camera.size) / 2.0) / camera.focal, np.ones(len(hips))])
    return np.asarray(ray / np.linalg.norm(ray, axis=-1, keepdims=True))


def facing(ray: Array) -> Array:
    """(T, 3, 3) rotations that turn the camera's z axis to the rays (T, 3) by the shortest way."""
    axis = np.cross([0.0, 0.0, 1.0], ray)
    sine = np.linalg.norm(axis, axis=-1, keepdims=True)
    angle = np.arctan2(sine, ray[:, 2:])
    return rotation_of(axis / np.maximum(sine, 1e-9) * angle)


def first_poses(
    observed: Observed, camera: SceneCamera, height: float, factors: Array, *, lift: bool
) -> tuple[Poses, SceneCamera]:
    """Poses for every frame, and the camera: with `lift` at the height at which the lowest feet stand on the
    floor.

    height: metres, of the person; factors: (L,) of the lengths.
    """
    turned = facing(rays(observed, camera))
    places = rough_scale(observed, height) * np.einsum("tij,tpj->tpi", turned, observed.world)
    shift = _shift(observed, places, camera)
    span = max(1.0, _DISTANCE_SPAN / float(np.median(np.diff(observed.times)))) if len(shift) > 1 else 1.0
    window = 2 * int(span) + 1
    shift = gaussian_filter1d(median_filter(shift, (window, 1), mode="nearest"), span, axis=0, mode="nearest")
    world = (places + shift[:, None]) @ camera.rotation + camera.place
    poses = _posed(world)
    if not lift:
        return poses, camera
    feet = [N[f"{name}_{side}"] for name in ("heel", "foot") for side in SIDES]
    lowest = place(poses, factors, height).points[:, feet, 2].min(axis=1)
    floor = float(np.percentile(lowest, _FLOOR_PERCENTILE))
    lifted = SceneCamera(camera.size, camera.focal, camera.height - floor, camera.pitch, camera.roll)
    return Poses(poses.root - [0.0, 0.0, floor], poses.turns, poses.hinges), lifted


def _shift(observed: Observed, places: Array, camera: SceneCamera) -> Array:
    """(T, 3) metres in the camera's axes that bring places (T, P, 3) to the pixels: linear least squares."""
    slope = (observed.pixels - np.array(camera.size) / 2.0) / camera.focal
    weight = np.where(np.isfinite(slope).all(axis=-1), observed.certainty, 0.0)
    slope, known = np.nan_to_num(slope), np.nan_to_num(places)
    zero, one = np.zeros_like(weight), np.ones_like(weight)
    rows = np.stack(
        [np.stack([one, zero, -slope[..., 0]], -1), np.stack([zero, one, -slope[..., 1]], -1)], axis=2
    )  # (T, P, 2, 3)
    right = slope * known[..., 2:] - known[..., :2]
    normal = np.einsum("tp,tpai,tpaj->tij", weight, rows, rows) + 1e-9 * np.eye(3)
    return np.asarray(
        np.linalg.solve(normal, np.einsum("tp,tpai,tpa->ti", weight, rows, right)[..., None])[..., 0]
    )


def _posed(p: Array) -> Poses:
    """Poses whose segments point as the places (T, P, 3) do, in the world."""
    frames = np.empty((len(p), len(SEGMENTS), 3, 3))
    hinges = np.zeros(frames.shape[:2])
    hips, shoulders = ((p[:, N[f"{j}_left"]] + p[:, N[f"{j}_right"]]) / 2.0 for j in ("hip", "shoulder"))
    up = shoulders - hips
    hip_line = p[:, N["hip_left"]] - p[:, N["hip_right"]]
    frames[:, 0] = _frame(up, hip_line)
    frames[:, 1] = _frame(up, p[:, N["shoulder_left"]] - p[:, N["shoulder_right"]])
    ears = (p[:, N["ear_left"]] + p[:, N["ear_right"]]) / 2.0
    frames[:, 2] = _frame(ears - shoulders, p[:, N["ear_left"]] - p[:, N["ear_right"]])
    k = 3
    for side in SIDES:
        hip, knee, ankle, heel, toe = (
            p[:, N[f"{j}_{side}"]] for j in ("hip", "knee", "instep", "heel", "foot")
        )
        frames[:, k], frames[:, k + 1], hinges[:, k + 1] = _limb(hip, knee, ankle, frames[:, 0], 1.0)
        # The sole's plane is poorly seen: the foot points forward, and its side is the shank's.
        frames[:, k + 2] = _pointing(toe - heel, frames[:, k + 1, :, 1])
        k += 3
    for side in SIDES:
        shoulder, elbow, wrist = (p[:, N[f"{j}_{side}"]] for j in ("shoulder", "elbow", "wrist"))
        frames[:, k], frames[:, k + 1], hinges[:, k + 1] = _limb(shoulder, elbow, wrist, frames[:, 1], -1.0)
        k += 2
    turns = frames.copy()
    for k, segment in enumerate(SEGMENTS):
        if segment.hinge is not None:
            turns[:, k] = rotation_of(hinges[:, k, None] * np.array(segment.hinge))
        elif segment.parent >= 0:
            turns[:, k] = frames[:, segment.parent].swapaxes(-1, -2) @ frames[:, k]
    return Poses(hips, turns, hinges)


def _limb(top: Array, middle: Array, end: Array, above: Array, sign: float) -> tuple[Array, Array, Array]:
    """Frames of both segments of a limb, and the angle of its hinge; sign: 1 for a knee, -1 for an elbow."""
    upper, lower = top - middle, middle - end
    bend = np.cross(upper, lower) * sign
    sine = np.linalg.norm(bend, axis=-1) / np.maximum(
        np.linalg.norm(upper, axis=-1) * np.linalg.norm(lower, axis=-1), 1e-9
    )
    side = above[..., 1]
    # A knee's axis points to the left; where the limb is straight, or bends the wrong way, it is the body's.
    trusted = np.clip(sine / _STRAIGHT - 1.0, 0.0, 1.0)[:, None]
    towards = np.sum(bend * side, axis=-1, keepdims=True)
    unit = bend / np.maximum(np.linalg.norm(bend, axis=-1, keepdims=True), 1e-9)
    if sign > 0.0:
        trusted = np.where(towards > 0.0, trusted, 0.0)
    first = _frame(upper, side * (1.0 - trusted) + unit * trusted)
    angle = np.arctan2(
        sign * np.sum(np.cross(upper, lower) * first[..., 1], axis=-1), np.sum(upper * lower, axis=-1)
    )
    angle = np.maximum(angle, 0.05)
    axis = np.array([0.0, sign, 0.0])
    return first, first @ rotation_of(angle[:, None] * axis), angle


def _frame(up: Array, left: Array) -> Array:
    """(T, 3, 3) rotations with z along `up` and y as near to `left` as possible."""
    z = _unit(up)
    x = _unit(np.cross(left, z))
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _pointing(forward: Array, left: Array) -> Array:
    """(T, 3, 3) rotations with x along `forward` and y as near to `left` as possible."""
    x = _unit(forward)
    z = _unit(np.cross(x, left))
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9))
