"""The terms of the fit: residuals in standard deviations, and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.body_fit.body import (
    LENGTHS,
    MEAN_HEIGHT,
    POINT_INDEX,
    POINTS,
    SEGMENTS,
    UNKNOWNS,
    kind_of,
)
from kinemimic.pipeline.body_fit.camera import CAMERA_UNKNOWNS, SceneCamera
from kinemimic.pipeline.body_fit.contacts import FEET
from kinemimic.pipeline.body_fit.normal_equations import NormalEquations
from kinemimic.pipeline.body_fit.observed import Observed
from kinemimic.pipeline.body_fit.pose import Placed, Poses, vector_of
from kinemimic.pipeline.body_fit.settings import ACCELERATIONS, POINT_ERRORS, FitSettings
from kinemimic.pipeline.kinematics.skeleton import SIDES

SHARED = len(LENGTHS) + len(CAMERA_UNKNOWNS)
# Pairs whose difference in depth is compared: the bones, and the widths of hips and shoulders.
BONES: tuple[tuple[str, str], ...] = (
    ("hip_left", "hip_right"),
    ("shoulder_left", "shoulder_right"),
    *(
        (f"{a}_{side}", f"{b}_{side}")
        for side in SIDES
        for a, b in (
            ("hip", "knee"),
            ("knee", "instep"),
            ("heel", "foot"),
            ("hip", "shoulder"),
            ("shoulder", "elbow"),
            ("elbow", "wrist"),
        )
    ),
)
STARTS, ENDS = ([POINT_INDEX[pair[k]] for pair in BONES] for k in (0, 1))
# Metres below the floor that are a standard deviation off.
_SUNK = 0.01
# A standing point further from the floor does not stand on it: a foot on a chair, a leg held up. Metres.
_ON_FLOOR = 0.06
_IMAGE_ERRORS: Array = np.array([POINT_ERRORS.get(kind_of(point.name), np.inf) for point in POINTS])


@dataclass(frozen=True)
class Evidence:
    """What the terms compare with, in T frames.

    observed: the points; rays: (T, 3) unit vectors to the body in the camera's axes; depths: (T, B) metres
    between the points of each of BONES along the rays; standing: (T, 4) of FEET, 0 to 1; share: square root
    of the share of a view that a frame counts as; step: seconds between frames; height: metres, of the
    person.
    """

    observed: Observed
    rays: Array
    depths: Array
    standing: Array
    share: float
    step: float
    height: float

    @property
    def size(self) -> float:
        """Of the person, relative to an average one."""
        return self.height / MEAN_HEIGHT


def image_residuals(evidence: Evidence, placed: Placed, camera: SceneCamera) -> tuple[Array, Array]:
    """Residuals (T, P, 2) in standard deviations, zero where a point is not seen, and weights (T, P) per
    pixel."""
    seen = camera.seen(placed.points)
    per_metre = camera.focal / np.maximum(seen[..., 2].mean(axis=1, keepdims=True), 0.3)
    weight = evidence.observed.certainty / (_IMAGE_ERRORS * evidence.size * per_metre)
    difference = camera.project_seen(seen) - evidence.observed.pixels
    weight = np.where(np.isfinite(difference).all(axis=-1), weight, 0.0)
    return np.nan_to_num(difference) * weight[..., None], weight


def add_image(
    equations: NormalEquations, evidence: Evidence, placed: Placed, camera: SceneCamera, settings: FitSettings
) -> None:
    """The points in the image, with Cauchy's robust weights."""
    residual, weight = image_residuals(evidence, placed, camera)
    seen = camera.seen(placed.points)
    robust = evidence.share / np.sqrt(1.0 + np.sum(residual**2, axis=-1) / settings.robust**2)
    T, P = weight.shape
    scale = (weight * robust)[..., None, None]
    by_point = camera.by_point(seen) * scale
    shared = np.concatenate([by_point @ placed.by_lengths, camera.by_camera(seen) * scale], axis=-1)
    equations.add(
        (residual * robust[..., None]).reshape(T, 2 * P),
        (by_point @ placed.by_unknowns).reshape(T, 2 * P, -1),
        shared.reshape(T, 2 * P, -1),
    )


def add_depth(
    equations: NormalEquations, evidence: Evidence, placed: Placed, camera: SceneCamera, settings: FitSettings
) -> None:
    """The rough depth between the ends of every bone, along the ray to the body."""
    error = settings.depth_error * evidence.size
    ray = evidence.rays @ camera.rotation  # in the world
    along = placed.points[:, STARTS] - placed.points[:, ENDS]
    certainty = np.minimum(evidence.observed.certainty[:, STARTS], evidence.observed.certainty[:, ENDS])
    residual = np.where(certainty > 0.0, (np.einsum("tbi,ti->tb", along, ray) - evidence.depths) / error, 0.0)
    robust = certainty * evidence.share / np.sqrt(1.0 + (residual / settings.robust) ** 2)
    weight = (robust / error)[..., None]
    by = np.einsum("ti,tbik->tbk", ray, placed.by_unknowns[:, STARTS] - placed.by_unknowns[:, ENDS])
    lengths = np.einsum("ti,tbil->tbl", ray, placed.by_lengths[:, STARTS] - placed.by_lengths[:, ENDS])
    equations.add(residual * robust, by * weight, _shared(lengths) * weight)


def add_floor(equations: NormalEquations, evidence: Evidence, placed: Placed, settings: FitSettings) -> None:
    """Feet that stand are on the floor and do not move; no foot is below it."""
    feet, by, by_lengths = placed.points[:, FEET], placed.by_unknowns[:, FEET], placed.by_lengths[:, FEET]
    up = feet[..., 2]
    # Geman and McClure's weights: a foot that is clearly elsewhere than on the floor is not drawn to it.
    on = np.sqrt(evidence.standing) / (1.0 + (up / (_ON_FLOOR * evidence.size)) ** 2)
    weight = np.where(up < 0.0, 1.0 / _SUNK, on / settings.floor_error) * (evidence.share / evidence.size)
    equations.add(
        up * weight, by[:, :, 2] * weight[..., None], _shared(by_lengths[:, :, 2]) * weight[..., None]
    )
    if len(feet) < 2:
        return
    T, F = up.shape
    both = np.sqrt(evidence.standing[1:] * evidence.standing[:-1])
    both *= evidence.share / (settings.slip * evidence.size * evidence.step)
    weights = np.repeat(both, 3, axis=1)
    moved = np.diff(feet, axis=0).reshape(T - 1, 3 * F)
    equations.add_differences(moved * weights, by.reshape(T, 3 * F, -1), weights)


def add_smoothness(equations: NormalEquations, evidence: Evidence, poses: Poses) -> None:
    """Accelerations are those of a person."""
    if len(poses.root) < 3:
        return
    steps = np.zeros((len(poses.root) - 1, UNKNOWNS.count))
    error = np.empty(UNKNOWNS.count)
    steps[:, :3], error[:3] = np.diff(poses.root, axis=0), ACCELERATIONS["root"] * evidence.size
    for k, segment in enumerate(SEGMENTS):
        columns = UNKNOWNS.columns(k)
        error[columns] = ACCELERATIONS[kind_of(segment.name)]
        if segment.hinge is not None:
            steps[:, columns] = np.diff(poses.hinges[:, k, None], axis=0)
        else:
            turn = poses.turns[:, k]
            steps[:, columns] = vector_of(turn[:-1].swapaxes(-1, -2) @ turn[1:])
    weight = np.broadcast_to(evidence.share / (error * evidence.step**2), (len(steps) - 1, len(error)))
    equations.add_second_differences(np.diff(steps, axis=0) * weight, weight)


def _shared(by_lengths: Array) -> Array:
    """Derivatives (..., L) by the lengths, with zeros (..., L + 4) for the camera."""
    return np.concatenate([by_lengths, np.zeros((*by_lengths.shape[:-1], len(CAMERA_UNKNOWNS)))], axis=-1)
