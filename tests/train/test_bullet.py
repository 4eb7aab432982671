"""The Bullet world obeys mechanics, and does the same thing twice."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.rotations import angle_between, from_rotvec, multiply
from kinemimic.retarget.body import BODIES, BODY_INDEX, TOTAL_MASS
from kinemimic.train.bullet import BulletWorld
from kinemimic.train.reference import Reference
from kinemimic.train.world import GRAVITY, SUBSTEPS, TIME_STEP, BodyStates, Poses

MASSES = np.array([body.mass for body in BODIES])
STEP = SUBSTEPS * TIME_STEP
HOLD = (np.tile([0.0, 0.0, 0.0, 1.0], (1, SUBSTEPS, 14, 1)), np.zeros((1, SUBSTEPS, 14, 3)))


def upright(height: float) -> Poses:
    still = np.zeros((1, 3))
    identity = np.array([[0.0, 0.0, 0.0, 1.0]])
    return Poses(
        np.array([[0.0, 0.0, height]]), identity, still, still, np.tile(identity[:, None], (1, 14, 1)),
        np.zeros((1, 14, 3)),
    )  # fmt: skip


def momentum(state: BodyStates) -> np.ndarray:
    return MASSES @ state.linear[0]


@pytest.fixture
def world() -> Iterator[BulletWorld]:
    made = BulletWorld(1, measure_torques=True)
    yield made
    made.close()


def test_reset_puts_every_body_where_the_reference_has_it(world: BulletWorld, motion) -> None:
    reference = Reference(motion)
    phase = np.array([0.37])
    world.reset(np.array([0]), reference.poses(phase))
    found, wanted = world.states(), reference.bodies(phase)
    np.testing.assert_allclose(found.positions, wanted.positions, atol=1e-5)
    assert angle_between(found.rotations, wanted.rotations).max() < 1e-5
    # Velocities of the tables are central differences over 2 ms; those of Bullet follow from the joints'.
    np.testing.assert_allclose(found.linear, wanted.linear, atol=5e-3)
    np.testing.assert_allclose(found.angular, wanted.angular, atol=2e-2)


def test_only_gravity_acts_in_the_air(world: BulletWorld, motion) -> None:
    """Joint torques are inner forces: a figure that strides in the air gains m g t and nothing else.

    Bullet's reduced coordinates keep momentum to the order of the time step only: 0.2 N·s of 94.6.
    """
    reference, raised = Reference(motion), np.array([[0.0, 0.0, 5.0]])
    pose = reference.poses(np.zeros(1))
    world.reset(np.array([0]), replace(pose, root=pose.root + raised))
    before = momentum(world.states())
    for k in range(6):
        at = (k * SUBSTEPS + 1 + np.arange(SUBSTEPS)) * TIME_STEP / motion.duration
        joints, velocities = reference.joints(at)
        state = world.step(joints[None], velocities[None])
    change = momentum(state) - before
    np.testing.assert_allclose(change, [0, 0, -TOTAL_MASS * GRAVITY * 6 * STEP], atol=0.2)


def test_a_push_changes_the_momentum_by_force_times_time(world: BulletWorld) -> None:
    """100 N for 0.2 s on the torso: 20 N·s, besides gravity's."""
    world.reset(np.array([0]), upright(5.0))
    wrench = np.zeros((1, 15, 6))
    wrench[0, BODY_INDEX["torso"], :3] = [0, 100.0, 0]
    for _ in range(6):
        state = world.step(*HOLD, wrench)
    np.testing.assert_allclose(momentum(state), [0, 20.0, -TOTAL_MASS * GRAVITY * 0.2], atol=0.05)


def test_a_torque_turns_about_its_own_axis(world: BulletWorld) -> None:
    """20 N·m about the vertical for 0.1 s: angular momentum 2 N·m·s about the centre of mass."""
    world.reset(np.array([0]), upright(5.0))
    wrench = np.zeros((1, 15, 6))
    wrench[0, BODY_INDEX["torso"], 3:] = [0, 0, 20.0]
    for _ in range(3):
        state = world.step(*HOLD, wrench)
    arm = state.positions[0] - MASSES @ state.positions[0] / TOTAL_MASS
    spin = np.cross(arm, MASSES[:, None] * state.linear[0]).sum(axis=0)
    # Ellipsoids hang upright, so that each body's own part about the vertical is its third moment.
    spin[2] += sum(body.inertia[2] * w for body, w in zip(BODIES, state.angular[0, :, 2], strict=True))
    assert spin[2] == pytest.approx(2.0, rel=0.03)


def test_the_ground_carries_the_weight(world: BulletWorld) -> None:
    """Standing still: both soles on the ground, which takes up all of m g, and ankles that hardly work."""
    world.reset(np.array([0]), upright(0.905))
    for _ in range(10):
        state = world.step(*HOLD)
    assert world.contacts().all()
    feet = state.positions[0, [BODY_INDEX["foot_left"], BODY_INDEX["foot_right"]], 2]
    np.testing.assert_allclose(feet, 0.025, atol=2e-3)
    # Without the ground a third of a second would have given 160 N·s.
    assert abs(momentum(state)[2]) < 1.0
    # The weight passes through the ankles: 473 N within the foot's 12 cm before them.
    ankles = world.peak_torques()[0, [BODY_INDEX["foot_left"] - 1, BODY_INDEX["foot_right"] - 1]]
    assert ankles.max() < 0.5 * TOTAL_MASS * GRAVITY * 0.12


def test_stable_pd_follows_a_turning_target(world: BulletWorld) -> None:
    """The target velocity is meant in the child's frame: with it the lag is far below the turn."""
    rate = np.random.default_rng(1).normal(size=(14, 3))
    start = from_rotvec(np.random.default_rng(2).normal(0, 0.3, (14, 3)))
    pose = upright(50.0)
    world.reset(
        np.array([0]),
        Poses(pose.root, pose.root_rotation, pose.root_linear, pose.root_angular, start[None], rate[None]),
    )
    for step in range(9):
        times = (step * SUBSTEPS + 1 + np.arange(SUBSTEPS)) * TIME_STEP
        targets = multiply(start, from_rotvec(times[:, None, None] * rate))
        state = world.step(targets[None], np.broadcast_to(rate, (1, SUBSTEPS, 14, 3)))
    assert angle_between(state.joints[0], targets[-1]).max() < np.radians(0.6)


def test_torques_stay_within_their_limits(world: BulletWorld) -> None:
    limits = np.array([body.torque_limit for body in BODIES[1:]])
    world.reset(np.array([0]), upright(5.0))
    targets = from_rotvec(np.full((1, SUBSTEPS, 14, 3), 0.8))
    world.step(targets, np.zeros((1, SUBSTEPS, 14, 3)))
    peaks = world.peak_torques()[0]
    assert (peaks <= limits * 1.001).all()
    # A knee asked to turn by 1.4 rad about an oblique axis saturates at once.
    assert peaks[BODY_INDEX["shin_left"] - 1] == pytest.approx(150.0, rel=1e-3)


def test_the_same_motion_twice_is_the_same_to_the_bit(motion) -> None:
    reference = Reference(motion)
    random = np.random.default_rng(3)
    phases = np.array([0.1, 0.6])
    corrections = random.normal(0, 0.05, (20, 2, 1, 14, 3))

    def play(world: BulletWorld) -> np.ndarray:
        world.reset(np.array([0, 1]), reference.poses(phases))
        rows = []
        for k, correction in enumerate(corrections):
            at = phases[:, None] + (k * SUBSTEPS + 1 + np.arange(SUBSTEPS)) * TIME_STEP / motion.duration
            joints, velocities = reference.joints(at)
            state = world.step(multiply(joints, from_rotvec(correction)), velocities)
            rows.append(np.concatenate([state.positions, state.linear, state.angular], axis=-1))
        return np.array(rows)

    one, two = BulletWorld(2), BulletWorld(2)
    first, again, other = play(one), play(one), play(two)
    one.close()
    two.close()
    assert first.tobytes() == again.tobytes() == other.tobytes()
