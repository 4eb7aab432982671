"""The area that bears weight against hand-computed distances, and against a solver's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import nnls

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.retarget.feet.contact import sole_positions
from kinemimic.retarget.feet.support import Support
from kinemimic.retarget.humanoid.body import STANDING_HEIGHT
from kinemimic.retarget.humanoid.motion import Motion

SQUARE = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]])


def support(*corners: Array) -> Support:
    """Of one frame for each (8, 2)."""
    return Support(np.arange(len(corners)), np.stack(corners))


def standing(frames: int = 5) -> Motion:
    """The neutral pose on the ground."""
    return Motion(
        rate=30.0,
        root=np.tile([0.0, 0.0, STANDING_HEIGHT], (frames, 1)),
        rotations=np.tile([0.0, 0.0, 0.0, 1.0], (frames, len(NODES), 1)),
        contacts=np.ones((frames, 2), dtype=np.bool_),
        cyclic=True,
    )


@pytest.mark.parametrize(
    ("point", "wanted"),
    [
        ((0.5, 0.5), (0.0, 0.0)),  # on both diagonals
        ((0.3, 0.6), (0.0, 0.0)),
        ((1.0, 0.4), (0.0, 0.0)),  # on the edge
        ((1.5, 0.4), (0.5, 0.0)),  # nearest to an edge
        ((0.2, -0.1), (0.0, -0.1)),
        ((-0.3, 1.4), (-0.3, 0.4)),  # nearest to a corner
    ],
)
def test_the_vector_from_a_square(point: tuple[float, float], wanted: tuple[float, float]) -> None:
    found = support(np.tile(SQUARE, (2, 1))).outside(np.array([point]))
    np.testing.assert_allclose(found, [wanted], atol=1e-12)


def test_it_is_the_nearest_point_of_the_hull() -> None:
    """Against non-negative least squares over the shares of the corners."""
    random = np.random.default_rng(0)
    corners, points = random.random((200, 8, 2)), random.random((200, 2))
    found = support(*corners).outside(points)
    for own, point, vector in zip(corners, points, found, strict=True):
        shares, _ = nnls(np.vstack([(own - point).T, np.full(8, 1e4)]), np.array([0.0, 0.0, 1e4]))
        np.testing.assert_allclose(vector, point - shares @ own / shares.sum(), atol=1e-6)
    assert 0.2 < np.mean(np.linalg.norm(found, axis=1) == 0.0) < 0.8


def test_both_soles_on_the_ground_bear_weight() -> None:
    motion = standing()
    found = Support.of(motion)
    np.testing.assert_array_equal(found.frames, np.arange(5))
    np.testing.assert_allclose(found.corners, sole_positions(*motion.kinematics())[..., :2].reshape(5, 8, 2))


def test_a_share_of_the_soles_is_around_their_middle() -> None:
    whole, part = (Support.of(standing(), sole).corners[0] for sole in ((1.0, 1.0), (0.25, 0.5)))
    for foot in (slice(0, 4), slice(4, 8)):
        np.testing.assert_allclose(part[foot].mean(axis=0), whole[foot].mean(axis=0), atol=1e-12)
        np.testing.assert_allclose(np.ptp(part[foot], axis=0), [0.25, 0.5] * np.ptp(whole[foot], axis=0))


def test_a_sole_in_the_air_bears_none() -> None:
    flying = replace(standing(), root=np.tile([0.0, 0.0, STANDING_HEIGHT + 0.5], (5, 1)))
    found = Support.of(flying)
    assert found.frames.shape == (0,)
    assert found.outside(np.zeros((5, 2))).shape == (0, 2)
