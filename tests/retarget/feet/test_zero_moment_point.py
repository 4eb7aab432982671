from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from peers.trackers import shipped_motion

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.retarget.feet.balance import centre_of_mass
from kinemimic.retarget.feet.contact import sole_positions
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.feet.zero_moment_point import WALK, balanced, zero_moment_point
from kinemimic.retarget.humanoid.body import BODIES, BODY_CENTERS, BODY_NODES, STANDING_HEIGHT, TOTAL_MASS
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.optimise.refine import refine

FRAMES, PERIOD = 60, 1.0
PHASE = np.arange(FRAMES) / FRAMES
LEGS = [NODE_INDEX[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle") for side in ("left", "right")]


def rigid(path: Array) -> Motion:
    """The neutral pose that moves along (T, 3) m about its standing place, and repeats."""
    return Motion(
        rate=FRAMES / PERIOD,
        root=path + np.array([0.0, 0.0, STANDING_HEIGHT]),
        rotations=np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, len(NODES), 1)),
        contacts=np.ones((FRAMES, 2), dtype=np.bool_),
        cyclic=True,
    )


def leaning(walk: Motion, degrees: float) -> Motion:
    """A walk whose trunk leans, as a sensor that is tilted shows it."""
    rotations = walk.rotations.copy()
    spine = NODE_INDEX["spine"]
    turn = np.broadcast_to(from_axis_angle("Y", np.radians(degrees)), rotations[:, spine].shape)
    rotations[:, spine] = multiply(turn, rotations[:, spine])
    return replace(walk, rotations=rotations)


def swaying(walk: Motion, metres: float) -> Motion:
    """A walk with more sway than the feet allow."""
    phase = np.arange(len(walk.root)) / len(walk.root)
    return replace(walk, root=walk.root + np.outer(np.sin(2.0 * np.pi * phase), [0.0, metres, 0.0]))


@pytest.fixture(scope="module")
def walk() -> Motion:
    return shipped_motion("walk")


def test_at_rest_it_is_below_the_centre_of_mass() -> None:
    motion = rigid(np.zeros((FRAMES, 3)))
    centre = centre_of_mass(*motion.kinematics())
    np.testing.assert_allclose(zero_moment_point(motion), centre[:, :2], atol=1e-9)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_rigid_sway_moves_it_as_a_cart_on_a_table(axis: int) -> None:
    """By hand: d = A cos(ωt) moves the point by d - (h/g) d'' = A (1 + h ω² / g) cos(ωt)."""
    amplitude, omega = 0.02, 2.0 * np.pi / PERIOD
    path = np.zeros((FRAMES, 3))
    path[:, axis] = amplitude * np.cos(omega * PERIOD * PHASE)
    motion = rigid(path)
    centre = centre_of_mass(*body_kinematics(motion.rotations, motion.root))
    height = centre[0, 2]
    wanted = centre[:, axis] - path[:, axis] + path[:, axis] * (1.0 + height * omega**2 / GRAVITY)
    np.testing.assert_allclose(zero_moment_point(motion)[:, axis], wanted, atol=1e-6)


def test_a_rising_body_does_not_move_it() -> None:
    path = np.zeros((FRAMES, 3))
    path[:, 2] = 0.03 * np.cos(2.0 * np.pi * PHASE)
    motion = rigid(path)
    np.testing.assert_allclose(zero_moment_point(motion), zero_moment_point(rigid(0.0 * path)), atol=1e-6)


@pytest.mark.parametrize(("axis", "moved", "sign"), [("Y", 0, -1.0), ("X", 1, 1.0)])
def test_a_body_that_turns_about_its_centre_of_mass_moves_it_by_its_angular_momentum(
    axis: str, moved: int, sign: float
) -> None:
    """By hand: the weight m g at a distance d from the centre of mass turns the body, I θ'' = -m g d about Y
    for a d along X, and I θ'' = m g d about X for a d along Y.

    I: of boxes (m/12 of the squared sides) and ellipsoids (m/20), with their m r² about the common centre.
    """
    amplitude, omega = 0.05, 2.0 * np.pi / PERIOD
    still = rigid(np.zeros((FRAMES, 3)))
    positions, frames = still.kinematics()
    centre = centre_of_mass(positions, frames)[0]
    theta = amplitude * np.sin(omega * PERIOD * PHASE)
    turn = from_axis_angle(axis, theta)
    rotations = still.rotations.copy()
    rotations[:, 0] = turn
    turning = replace(still, root=centre + rotate(turn, still.root - centre), rotations=rotations)

    across = [0, 2] if axis == "Y" else [1, 2]
    inertia = 0.0
    for body, place in zip(BODIES, positions[0, BODY_NODES] + BODY_CENTERS, strict=True):
        sides = np.square([body.size[k] for k in across]).sum() / (12.0 if body.shape == "box" else 20.0)
        inertia += body.mass * (sides + np.square((place - centre)[across]).sum())
    shift = zero_moment_point(turning) - centre[:2]
    wanted = sign * inertia * -(omega**2) * theta / (TOTAL_MASS * GRAVITY)
    small = 1e-3 * np.abs(wanted).max()  # also of what the products of inertia move across
    np.testing.assert_allclose(shift[:, moved], wanted, atol=small)
    np.testing.assert_allclose(shift[:, 1 - moved], 0.0, atol=small)


def test_who_stands_balanced_is_left_alone() -> None:
    motion = rigid(np.zeros((FRAMES, 3)))
    found, balance = balanced(motion)
    assert balance is not None
    assert balance.outside_before == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(found.root, motion.root, atol=1e-9)
    np.testing.assert_allclose(found.rotations, motion.rotations, atol=1e-9)


@pytest.mark.parametrize(
    "spoil", [lambda w: leaning(w, 12.0), lambda w: leaning(w, -12.0), lambda w: swaying(w, 0.03)]
)
def test_a_walk_that_would_fall_comes_nearer_to_its_feet(walk: Motion, spoil: object) -> None:
    spoiled = refine(spoil(walk))  # type: ignore[operator]
    found, balance = balanced(spoiled)
    assert balance is not None
    assert balance.outside < 0.75 * balance.outside_before
    assert 0.005 < balance.displacement < np.sqrt(2.0) * WALK.largest + 1e-9
    others = [node for node in range(len(NODES)) if node not in LEGS]
    np.testing.assert_array_equal(found.rotations[:, others], spoiled.rotations[:, others])
    np.testing.assert_array_equal(found.contacts, spoiled.contacts)
    # The soles in contact stay where they were, to some millimetres.
    moved = np.linalg.norm(
        sole_positions(*found.kinematics()) - sole_positions(*spoiled.kinematics()), axis=-1
    )
    assert np.median(moved[spoiled.contacts]) < 0.005


def test_a_loop_of_a_few_frames_is_left_alone(walk: Motion) -> None:
    few = slice(None, None, len(walk.root) // 10)
    short = replace(
        walk, rate=10.0, root=walk.root[few], rotations=walk.rotations[few], contacts=walk.contacts[few]
    )
    assert balanced(short) == (short, None)


def test_without_support_nothing_changes(walk: Motion) -> None:
    flying = replace(walk, root=walk.root + np.array([0.0, 0.0, 1.0]))
    found, balance = balanced(flying)
    assert balance is None
    assert found is flying
