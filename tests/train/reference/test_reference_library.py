from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.rotations import angle_between
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.reference.reference import Reference
from kinemimic.train.reference.reference_library import FollowedReference, ReferenceLibrary


@pytest.fixture(scope="module")
def motions(motion: Motion) -> list[Motion]:
    """A cycle, the same slower, and the same once."""
    return [
        motion,
        replace(motion, rate=0.8 * motion.rate),
        replace(motion, cyclic=False, cycle_offset=np.zeros(3)),
    ]


@pytest.fixture(scope="module")
def library(motions: list[Motion]) -> ReferenceLibrary:
    return ReferenceLibrary(motions)


def test_every_environment_follows_its_own_motion(motions: list[Motion], library: ReferenceLibrary) -> None:
    who = np.array([2, 0, 1, 0])
    phases = np.array([[0.3, 1.2], [0.99, 3.4], [-0.2, 0.5], [0.0, 1.0]])
    followed = FollowedReference(library, who)
    bodies, (joints, speeds), targets = (
        followed.bodies(phases),
        followed.joints(phases),
        followed.targets(phases),
    )
    for row, index in enumerate(who):
        own = Reference(motions[index])
        expected = own.bodies(phases[row])
        np.testing.assert_allclose(bodies.positions[row], expected.positions, atol=5e-4)
        np.testing.assert_allclose(bodies.linear[row], expected.linear, atol=0.02)
        np.testing.assert_allclose(bodies.angular[row], expected.angular, atol=0.05)
        assert angle_between(bodies.rotations[row], expected.rotations).max() < 2e-3
        assert angle_between(joints[row], own.joints(phases[row])[0]).max() < 2e-3
        np.testing.assert_allclose(speeds[row], own.joints(phases[row])[1], atol=0.05)
        assert angle_between(targets[0][row], own.targets(phases[row])[0]).max() < 0.01
        np.testing.assert_allclose(followed.root(phases)[row], own.root(phases[row]), atol=5e-4)
        assert angle_between(followed.nodes(phases)[row], own.nodes(phases[row])).max() < 2e-3


def test_parts_join_to_the_same_library(motions: list[Motion], library: ReferenceLibrary) -> None:
    joined = ReferenceLibrary.joined([ReferenceLibrary(motions[:1]), ReferenceLibrary(motions[1:])])
    assert len(joined) == len(motions)
    for name in ("rows", "starts", "durations", "cyclic", "cycle_offsets"):
        np.testing.assert_array_equal(getattr(joined, name), getattr(library, name))
    for name, table in library.tables.items():
        np.testing.assert_array_equal(joined.tables[name], table)


def test_duration_and_cycles_are_those_of_the_followed_motion(
    motions: list[Motion], library: ReferenceLibrary
) -> None:
    followed = FollowedReference(library, np.array([1, 2]))
    np.testing.assert_allclose(followed.duration, [motions[1].duration, motions[2].duration])
    assert followed.cyclic.tolist() == [True, False]
    np.testing.assert_allclose(followed.cycle_offset, [motions[1].cycle_offset, np.zeros(3)])
    followed.motions[0] = 0
    assert followed.duration[0] == pytest.approx(motions[0].duration)


def test_a_part_of_the_batch_starts_on_its_own_motions(library: ReferenceLibrary) -> None:
    followed = FollowedReference(library, np.array([0, 1, 2]))
    phases = np.array([0.1, 0.6])
    part, whole = followed.of(np.array([0, 2])).poses(phases), followed.poses(np.array([0.1, 0.0, 0.6]))
    for name, value in vars(part).items():
        np.testing.assert_array_equal(value, getattr(whole, name)[[0, 2]])


def test_the_pace_moves_the_path_and_not_the_steps(motions: list[Motion], library: ReferenceLibrary) -> None:
    who, phases = np.array([0, 2]), np.array([[1.3, 2.6], [0.3, 0.6]])
    usual, fast = (FollowedReference(library, who, np.full(2, pace)).bodies(phases) for pace in (1.0, 1.2))
    ahead = 0.2 * phases[0][:, None, None] * motions[0].cycle_offset
    np.testing.assert_allclose(fast.positions[0] - usual.positions[0], ahead * np.ones((2, 15, 1)), atol=1e-6)
    faster = 0.2 * motions[0].cycle_offset / motions[0].duration
    np.testing.assert_allclose(fast.linear[0] - usual.linear[0], np.tile(faster, (2, 15, 1)), atol=1e-6)
    np.testing.assert_array_equal(fast.rotations, usual.rotations)
    # A motion that is no cycle keeps its path.
    np.testing.assert_array_equal(fast.positions[1], usual.positions[1])
