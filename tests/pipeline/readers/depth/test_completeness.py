"""Which joints of a frame are on valid depth."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import pytest
from numpy.typing import NDArray
from samples.depth_scene import HALF, body, millimetres, plane, render, to_camera, walker

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.readers.depth.camera import Camera
from kinemimic.pipeline.readers.depth.completeness import MAX_BEFORE, MAX_BEHIND, DepthCheck, check

CAMERA = Camera(*astuple(HALF))
NOT_GIVEN = np.nan


def wall(depth: float = 3.0) -> NDArray[np.float32]:
    return np.full((CAMERA.height, CAMERA.width), depth, dtype=np.float32)


def check_of(image: NDArray[np.float32], pixel: tuple[float, float], given: float = NOT_GIVEN) -> DepthCheck:
    return DepthCheck(int(check(image, CAMERA, np.array([pixel]), np.array([given])).checks[0]))


def figure(frame: int = 30) -> tuple[NDArray[np.float32], Array, Array]:
    """A frame of the walk: its image, pixels (20, 2), depths (20,)."""
    joints = to_camera(walker(frame + 1)[frame])
    image = render(HALF, body(joints), plane(HALF, np.array([0.0, 0.0, 1.0]), 6.0))
    return (millimetres(image) / 1000.0).astype(np.float32), HALF.project(joints), joints[:, 2]


@pytest.mark.parametrize("frame", [0, 30, 59])
def test_a_dead_region_takes_exactly_the_joints_in_it(frame: int) -> None:
    image, pixels, depth = figure(frame)
    whole = check(image, CAMERA, pixels, depth)
    assert whole.complete
    centres = np.rint(pixels).astype(int)
    # The lower half of the body, the left half of the image, and a square about a hand.
    hand = centres[NODES.index("hand_left")]
    for rows, columns in (
        (np.s_[centres[NODES.index("spine"), 1] :], np.s_[:]),
        (np.s_[:], np.s_[: centres[NODES.index("head"), 0]]),
        (np.s_[hand[1] - 6 : hand[1] + 7], np.s_[hand[0] - 6 : hand[0] + 7]),
    ):
        dead = np.zeros(image.shape, dtype=np.bool_)
        dead[rows, columns] = True
        found = check(np.where(dead, np.float32(0), image), CAMERA, pixels, depth)
        assert (found.checks == DepthCheck.NO_DEPTH).tolist() == dead[centres[:, 1], centres[:, 0]].tolist()
        assert (found.states == 0).tolist() == np.isnan(found.depth).tolist()
        assert not found.complete


def test_the_edge_of_a_dead_region_is_its_edge() -> None:
    image = wall()
    image[:, 100:] = 0
    assert check_of(image, (99.4, 50)) is DepthCheck.SEEN
    assert check_of(image, (99.6, 50)) is DepthCheck.NO_DEPTH


def test_a_small_hole_makes_a_joint_inferred() -> None:
    image = wall()
    image[47:54, 97:104] = 0
    found = check(image, CAMERA, np.array([[100.0, 50.0], [150.0, 50.0]]), np.full(2, NOT_GIVEN))
    assert found.checks.tolist() == [DepthCheck.FILLED, DepthCheck.SEEN]
    assert found.states.tolist() == [1, 2]
    assert found.depth == pytest.approx([3.0, 3.0])
    assert found.complete


def test_at_an_edge_the_nearer_side_is_taken() -> None:
    image = wall(4.0)
    image[:, 100:] = 2.5
    # Three columns of the window lie on the wall behind, two on the body.
    found = check(image, CAMERA, np.array([[99.0, 50.0]]), np.array([NOT_GIVEN]))
    assert found.checks.tolist() == [DepthCheck.EDGE]
    assert found.states.tolist() == [1]
    assert found.depth == pytest.approx([2.5])


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (3.0, DepthCheck.SEEN),
        (3.0 + MAX_BEHIND - 0.01, DepthCheck.SEEN),
        (3.0 + MAX_BEHIND + 0.01, DepthCheck.DISAGREES),
        (3.0 - MAX_BEFORE + 0.01, DepthCheck.SEEN),
        (3.0 - MAX_BEFORE - 0.01, DepthCheck.DISAGREES),
    ],
)
def test_a_joint_is_inside_the_body_behind_its_surface(given: float, expected: DepthCheck) -> None:
    found = check(wall(), CAMERA, np.array([[60.0, 60.0]]), np.array([given]))
    assert found.checks.tolist() == [expected]
    assert found.depth == pytest.approx([given])  # what the tracker says is not overruled


def test_a_joint_on_the_background_is_missing() -> None:
    image = wall(2.5)
    image[:, 200:] = 5.0
    pixels = np.array([[50.0, 50.0], [80.0, 90.0], [250.0, 50.0]])
    found = check(image, CAMERA, pixels, np.full(3, NOT_GIVEN))
    assert found.checks.tolist() == [DepthCheck.SEEN, DepthCheck.SEEN, DepthCheck.BACKGROUND]
    assert np.isnan(found.depth).tolist() == [False, False, True]


def test_no_pixel_and_a_pixel_outside_are_missing() -> None:
    pixels = np.array([[np.nan, np.nan], [-1.0, 5.0], [400.0, 5.0], [0.0, 0.0]])
    found = check(wall(), CAMERA, pixels, np.full(4, NOT_GIVEN))
    # Nine of the window's 25 pixels lie inside the image at its very corner: too few.
    assert found.checks.tolist() == [
        DepthCheck.ABSENT,
        DepthCheck.OUTSIDE,
        DepthCheck.OUTSIDE,
        DepthCheck.NO_DEPTH,
    ]
    assert check_of(wall(), (2.0, 0.0)) is DepthCheck.SEEN


def test_a_dead_image_and_no_joints_are_no_special_case() -> None:
    nobody = check(np.zeros_like(wall()), CAMERA, np.array([[9.0, 9.0]]), np.array([2.0]))
    assert nobody.states.tolist() == [0]
    assert check(wall(), CAMERA, np.full((3, 2), np.nan), np.full(3, np.nan)).states.tolist() == [0, 0, 0]
