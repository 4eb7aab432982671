"""What is expected without a look at the clip: limits of the joints, lengths, and the camera."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.body_fit.body import LENGTH_NAMES, LENGTHS, SEGMENTS, STATURE, UNKNOWNS, kind_of
from kinemimic.pipeline.body_fit.camera import SceneCamera
from kinemimic.pipeline.body_fit.normal_equations import NormalEquations
from kinemimic.pipeline.body_fit.pose import Poses, vector_of
from kinemimic.pipeline.body_fit.settings import RANGES, FitSettings

# Radians: how far a hinge bends, and beyond its limit a standard deviation.
HINGE_RANGE = (0.0, 2.7)
_LIMIT = 0.05
# Radians: sideways and about its own axis, of a thigh; sideways, of the pelvis against the floor.
_ABDUCTION, _AXIAL, _OBLIQUITY = 0.25, 0.25, 0.10
# Of the logarithm of the person's height, which is given or assumed.
_STATURE_ERROR = 0.003
_FIXED = 1e-4


def add_limits(equations: NormalEquations, poses: Poses, share: float) -> None:
    """Hinges bend one way only; joints are rarely far from standing upright.

    share: square root of the share of a view that a frame counts as.
    """
    residuals: list[Array] = []
    rows: list[Array] = []

    def add(residual: Array, error: float, first: int, by: Array) -> None:
        row = np.zeros((len(residual), UNKNOWNS.count))
        row[:, first : first + by.shape[-1]] = by / error
        residuals.append(residual / error)
        rows.append(row)

    zero, one = np.zeros(len(poses.root)), np.ones((len(poses.root), 1))
    for k, segment in enumerate(SEGMENTS):
        first, turn = UNKNOWNS.first[k], poses.turns[:, k]
        if segment.hinge is not None:
            beyond = poses.hinges[:, k] - np.clip(poses.hinges[:, k], *HINGE_RANGE)
            add(beyond, _LIMIT, first, (beyond != 0.0)[:, None] * one)
        elif kind_of(segment.name) == "thigh":
            # How far its axis, and its front, point to the side of the pelvis.
            add(turn[:, 1, 2], _ABDUCTION, first, np.stack([-turn[:, 1, 1], turn[:, 1, 0], zero], axis=-1))
            add(turn[:, 1, 0], _AXIAL, first, np.stack([zero, -turn[:, 1, 2], turn[:, 1, 1]], axis=-1))
        elif kind_of(segment.name) == "pelvis":
            # How far the left hip is above the right.
            add(turn[:, 2, 1], _OBLIQUITY, first, np.stack([turn[:, 2, 2], zero, -turn[:, 2, 0]], axis=-1))
        else:
            vector = vector_of(turn)
            for axis, error in enumerate(RANGES[kind_of(segment.name)]):
                add(vector[:, axis], error, first + axis, one)
    equations.add(np.stack(residuals, axis=1) * share, np.stack(rows, axis=1) * share)


def add_scene(
    equations: NormalEquations,
    factors: Array,
    camera: SceneCamera,
    assumed: SceneCamera,
    settings: FitSettings,
    weight: float,
) -> None:
    """Lengths are near an average person's, the camera is nearly level, its focal length near the assumed.

    weight: what one view would count as. A focal length that is given (`settings.focal_known`) stays.
    """
    focal = _FIXED if settings.focal_known else settings.focal_error
    errors = np.array(
        [*(error for _, error in LENGTHS.values()), np.inf, settings.pitch_error, settings.roll_error, focal]
    )
    values = np.array(
        [*np.log(factors), 0.0, camera.pitch, camera.roll, np.log(camera.focal / assumed.focal)]
    )
    equations.add_shared(values * weight / errors, np.diag(weight / errors))
    # The height of the person fixes the sum of legs and trunk, and with it the scale of the scene.
    row = np.zeros(len(values))
    total = sum(LENGTHS[name][0] for name in STATURE)
    for name in STATURE:
        row[LENGTH_NAMES.index(name)] = LENGTHS[name][0] / total
    row *= weight / _STATURE_ERROR
    equations.add_shared(np.array([row @ values]), row[None])
