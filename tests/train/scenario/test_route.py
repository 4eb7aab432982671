"""Routes: lengths and turns are as given, and a steered reference is consistent."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from peers.elsewhere import on_the_spot, turned

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.rotations import angle_between, conjugate, multiply, to_rotvec
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.reference.reference import Reference
from kinemimic.train.scenario.route import Route, SteeredReference, reference_for
from kinemimic.train.scenario.scenario import Scenario

QUARTER = 0.5 * math.pi
BEND = Route([(2.0, 0.0), (3.0, QUARTER), (2.0, 0.0), (3.0, -QUARTER), (1.0, 0.0)])


def test_a_route_has_its_turns_and_its_length() -> None:
    along = np.linspace(-3.0, 16.0, 4001)
    points, heading, bend = BEND.at(along)
    speed = np.linalg.norm(np.diff(points, axis=0), axis=-1) / np.diff(along)
    np.testing.assert_allclose(speed, 1.0, atol=1e-3)
    np.testing.assert_allclose(np.gradient(heading, along), bend, atol=0.01)
    for distance, angle in ((-3.0, 0.0), (1.0, 0.0), (3.5, 0.5 * QUARTER), (6.0, QUARTER), (12.0, 0.0)):
        assert BEND.at(np.array(distance))[1] == pytest.approx(angle, abs=0.01)
    np.testing.assert_allclose(BEND.at(np.array(0.0))[0], 0.0, atol=1e-9)
    # A quarter of a circle to the left and one to the right, each of radius r, and 2 m between them.
    radius = 3.0 / QUARTER
    np.testing.assert_allclose(BEND.at(np.array(11.0))[0], [3.0 + 2 * radius, 2.0 + 2 * radius], atol=0.03)


def test_a_straight_route_changes_nothing(motion: Motion) -> None:
    plain, steered = Reference(motion), SteeredReference(motion, Route([(5.0, 0.0)]))
    phases = np.linspace(0.0, 3.0, 50)
    for a, b in zip(vars(plain.bodies(phases)).values(), vars(steered.bodies(phases)).values(), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)
    np.testing.assert_allclose(plain.root(phases), steered.root(phases), atol=1e-9)
    np.testing.assert_allclose(plain.nodes(phases), steered.nodes(phases), atol=1e-12)


def test_velocities_are_derivatives_of_positions(motion: Motion) -> None:
    reference = SteeredReference(motion, BEND)
    phases = np.linspace(0.0, 8.0, 8001)
    step = (phases[1] - phases[0]) * reference.duration
    bodies = reference.bodies(phases)
    linear = np.gradient(bodies.positions, step, axis=0)
    np.testing.assert_allclose(bodies.linear[5:-5], linear[5:-5], atol=0.02)
    change = to_rotvec(multiply(bodies.rotations[2:], conjugate(bodies.rotations[:-2]))) / (2 * step)
    np.testing.assert_allclose(bodies.angular[6:-6], change[5:-5], atol=0.05)


def test_root_bodies_and_nodes_agree(motion: Motion) -> None:
    reference = SteeredReference(motion, BEND)
    phases = np.linspace(0.0, 8.0, 40)
    poses, bodies = reference.poses(phases), reference.bodies(phases)
    np.testing.assert_allclose(poses.root, reference.root(phases))
    np.testing.assert_allclose(bodies.positions[:, 0], reference.root(phases), atol=1e-9)
    assert angle_between(reference.nodes(phases)[:, 0], bodies.rotations[:, 0]).max() < 1e-6
    np.testing.assert_allclose(bodies.joints, Reference(motion).bodies(phases).joints, atol=1e-9)


def test_a_route_does_not_change_joints_and_feed_forward(motion: Motion) -> None:
    """The torques, computed from the first cycle, do not contain its bend."""
    plain, steered = Reference(motion), SteeredReference(motion, Route([(1.0, 1.0)]))
    phases = np.linspace(0.0, 2.0, 60)
    for a, b in zip(plain.targets(phases), steered.targets(phases), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)


def test_lengths_need_not_be_whole_centimetres() -> None:
    for length in (0.515, 1.237, 2.0):
        assert Route([(length, 1.0)]).at(np.array(9.0))[1] == pytest.approx(1.0, abs=1e-3)


def test_only_a_gait_along_x_can_be_steered(motion: Motion) -> None:
    for other in (turned(motion, 1.0), replace(motion, cyclic=False), on_the_spot(motion)):
        with pytest.raises(KinemimicError, match="expected a straight walk or run to steer"):
            SteeredReference(other, BEND)


def test_a_scenario_without_a_route_leaves_the_reference(motion: Motion) -> None:
    assert type(reference_for(motion, None)) is Reference
    assert type(reference_for(motion, Scenario("straight"))) is Reference
    assert type(reference_for(motion, Scenario("bent", route=((3.0, QUARTER),)))) is SteeredReference
