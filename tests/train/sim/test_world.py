"""Both engines obey mechanics and are deterministic."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from peers.stance import HOLD, MASSES, STEP, momentum, upright

from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.rotations import angle_between, from_rotvec, multiply, to_matrix
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX, TOTAL_MASS
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import SUBSTEPS, TIME_STEP, BodyStates, Obstacle, Poses, World


def test_reset_puts_every_body_where_the_reference_has_it(world: World, motion) -> None:
    reference = Reference(motion)
    phase = np.array([0.37])
    world.reset(np.array([0]), reference.poses(phase))
    found, wanted = world.states(), reference.bodies(phase)
    np.testing.assert_allclose(found.positions, wanted.positions, atol=1e-5)
    assert angle_between(found.rotations, wanted.rotations).max() < 1e-5
    # Velocities of the tables are central differences over 2 ms; those of Bullet follow from the joints'.
    np.testing.assert_allclose(found.linear, wanted.linear, atol=5e-3)
    np.testing.assert_allclose(found.angular, wanted.angular, atol=2e-2)


def test_only_gravity_acts_in_the_air(world: World, motion) -> None:
    """Joint torques are inner forces: a humanoid that strides in the air gains m g t and nothing else.

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


def test_joints_that_strive_in_the_air_keep_the_angular_momentum(world: World) -> None:
    """Gravity acts at the centre of mass and joint torques in pairs: whatever the joints do, the angular
    momentum about the centre of mass stays 0. Bullet's reduced coordinates keep it to the order of the time
    step: 3 % of the largest sum over the bodies. Torques without their counterparts would give all of it."""
    turned = from_rotvec(np.random.default_rng(4).normal(0, 0.6, (14, 3)))
    world.reset(np.array([0]), upright(5.0))
    whole, largest = 0.0, 0.0
    for _ in range(6):
        state = world.step(np.broadcast_to(turned, (1, SUBSTEPS, 14, 4)), np.zeros((1, SUBSTEPS, 14, 3)))
        parts = angular_momenta(state)
        largest = max(largest, np.abs(parts).sum(axis=0).max())
        whole = max(whole, np.abs(parts.sum(axis=0)).max())
    assert largest > 15.0
    assert whole < 0.05 * largest


def angular_momenta(state: BodyStates) -> np.ndarray:
    """Of the 15 bodies about the common centre of mass, N·m·s: r x m v and that of their own turn, by the
    integrals of x² over boxes (m/12 of the squared sides) and ellipsoids (m/20)."""
    arm = state.positions[0] - MASSES @ state.positions[0] / TOTAL_MASS
    way = state.linear[0] - MASSES @ state.linear[0] / TOTAL_MASS
    squares = np.array(
        [np.square(body.size) * body.mass / (12.0 if body.shape == "box" else 20.0) for body in BODIES]
    )
    matrix = to_matrix(state.rotations[0])
    moment = np.einsum("bij,bj,bkj->bik", matrix, squares, matrix)
    inertia = np.trace(moment, axis1=1, axis2=2)[:, None, None] * np.eye(3) - moment
    return np.asarray(
        np.cross(arm, MASSES[:, None] * way) + np.einsum("bij,bj->bi", inertia, state.angular[0])
    )


def test_fast_joints_do_not_add_momentum(world: World) -> None:
    """Joints at 17 rad/s, in the air: only gravity changes the momentum, and nothing gets faster.

    Undivided steps would make energy, and Bullet's limit of joint speeds momentum: 1,500 N·s were seen.
    """
    whirl = np.random.default_rng(5).normal(0, 10.0, (1, 14, 3))
    world.reset(np.array([0]), replace(upright(50.0), joint_velocities=whirl))
    before = momentum(world.states())
    for _ in range(9):
        state = world.step(*HOLD)
    change = momentum(state) - before - [0, 0, -TOTAL_MASS * GRAVITY * 9 * STEP]
    assert not world.exploded().any()
    assert np.linalg.norm(change) < 10.0
    assert np.linalg.norm(state.linear[0], axis=-1).max() < 15.0


def test_standing_soles_are_on_the_ground_and_ankles_hardly_work(world: World) -> None:
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


def test_stable_pd_follows_a_turning_target(world: World) -> None:
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


def test_torques_stay_within_their_limits(world: World) -> None:
    limits = np.array([body.torque_limit for body in BODIES[1:]])
    world.reset(np.array([0]), upright(5.0))
    targets = from_rotvec(np.full((1, SUBSTEPS, 14, 3), 0.8))
    world.step(targets, np.zeros((1, SUBSTEPS, 14, 3)))
    peaks = world.peak_torques()[0]
    assert (peaks <= limits * 1.001).all()
    # A knee asked to turn by 1.4 rad about an oblique axis saturates at once.
    assert peaks[BODY_INDEX["shin_left"] - 1] == pytest.approx(150.0, rel=1e-3)


def test_the_same_motion_twice_is_the_same_to_the_bit(motion, engine: str) -> None:
    reference = Reference(motion)
    random = np.random.default_rng(3)
    phases = np.array([0.1, 0.6])
    corrections = random.normal(0, 0.05, (20, 2, 1, 14, 3))

    def play(world: World) -> np.ndarray:
        world.reset(np.array([0, 1]), reference.poses(phases))
        rows = []
        for k, correction in enumerate(corrections):
            at = phases[:, None] + (k * SUBSTEPS + 1 + np.arange(SUBSTEPS)) * TIME_STEP / motion.duration
            joints, velocities = reference.joints(at)
            state = world.step(multiply(joints, from_rotvec(correction)), velocities)
            rows.append(np.concatenate([state.positions, state.linear, state.angular], axis=-1))
        return np.array(rows)

    one, two = open_world(2, engine), open_world(2, engine)
    first, again, other = play(one), play(one), play(two)
    one.close()
    two.close()
    assert first.tobytes() == again.tobytes() == other.tobytes()


def test_the_ground_holds_a_foot_with_nine_tenths_of_its_weight(world: World) -> None:
    """Friction is 0.9: a standing humanoid stays under a smaller push and slides under a larger one.

    The push is on the feet themselves, so that nothing topples at once.
    """
    feet = [BODY_INDEX["foot_left"], BODY_INDEX["foot_right"]]
    moved = []
    for share in (0.8, 1.0):
        world.reset(np.array([0]), upright(0.905))
        for _ in range(10):
            start = world.step(*HOLD).positions[0, feet].copy()
        wrench = np.zeros((1, 15, 6))
        wrench[0, feet, 0] = 0.5 * share * TOTAL_MASS * GRAVITY
        for _ in range(4):
            end = world.step(*HOLD, wrench).positions[0, feet].copy()
        moved.append(float(np.abs(end - start)[:, 0].max()))
    assert moved[0] < 0.004
    assert moved[1] > 3 * moved[0]


def test_an_exploded_humanoid_is_frozen_until_its_reset(world: World) -> None:
    """After a push of a thousand tonnes the humanoid keeps its last valid state; a reset restores it."""
    world.reset(np.array([0]), upright(3.0))
    sound = world.step(*HOLD).positions.copy()
    assert not world.exploded().any()
    wrench = np.zeros((1, 15, 6))
    wrench[0, BODY_INDEX["head"], 0] = 1e7
    for _ in range(2):
        state = world.step(*HOLD, wrench)
        assert world.exploded().all()
        assert np.isfinite(state.positions).all()
        assert np.isfinite(state.angular).all()
        np.testing.assert_allclose(state.positions, sound, atol=0.1)
    world.reset(np.array([0]), upright(3.0))
    assert not world.exploded().any()
    assert world.step(*HOLD).positions.tobytes() == sound.tobytes()


def test_a_frozen_humanoid_waits_for_its_reset_and_leaves_the_others_as_they_were(engine: str) -> None:
    """Also its obstacle. The other one moves as without it, to the last bit."""
    pair, alone = open_world(2, engine), open_world(1, engine)
    ball = Obstacle("sphere", (0.2, 0.2, 0.2), (0.0, 1.0, 2.0), mass=1.0)
    both = Poses(*(np.repeat(value, 2, axis=0) for value in vars(upright(3.0)).values()))
    commands = tuple(np.repeat(value, 2, axis=0) for value in HOLD)
    for world, poses in ((pair, both), (alone, upright(3.0))):
        for index in range(world.size):
            world.place(index, [ball])
        world.reset(np.arange(world.size), poses)
    still = pair.step(*commands).positions[0].copy()
    hung = pair.obstacles(0).copy()
    moved = alone.step(*HOLD).positions[0].copy()
    pair.freeze(np.array([0]))
    for _ in range(3):
        positions, (expected,) = pair.step(*commands).positions, alone.step(*HOLD).positions
        assert positions[0].tobytes() == still.tobytes()
        assert positions[1].tobytes() == expected.tobytes()
        np.testing.assert_array_equal(pair.obstacles(0), hung)
    assert expected[0, 2] < moved[0, 2] - 0.05
    pair.reset(np.array([0]), upright(3.0))
    assert pair.step(*commands).positions[0].tobytes() == moved.tobytes()
    pair.close()
    alone.close()


def test_states_are_read_only_views(world: World) -> None:
    state = world.states()
    world.reset(np.array([0]), upright(1.7))
    assert state.positions[0, 0, 2] == pytest.approx(1.7)
    with pytest.raises(ValueError, match="read-only"):
        state.positions[0] = 0.0


@pytest.mark.parametrize("name", ["root", "root_rotation", "root_angular", "joints", "joint_velocities"])
def test_a_reset_to_an_invalid_pose_is_an_explosion(world: World, name: str) -> None:
    """NaN does not spread, and the next reset restores the humanoid."""
    pose = upright(0.905)
    for value in (np.nan, np.inf):
        broken = getattr(pose, name).copy()
        broken.flat[-1] = value
        world.reset(np.array([0]), replace(pose, **{name: broken}))
        assert world.exploded().all()
        for state in (world.states(), world.step(*HOLD)):
            assert all(np.isfinite(values).all() for values in vars(state).values())
        assert not world.contacts().any()
        assert not world.contact_forces().any()
        world.reset(np.array([0]), pose)
        assert not world.exploded().any()
        assert np.isfinite(world.step(*HOLD).positions).all()


def test_the_speed_limit_applies_to_norms_not_components(world: World) -> None:
    for speed, exploded in ((65.0, False), (75.0, True)):
        fast = replace(upright(50.0), root_linear=np.array([[speed, speed, 0.0]]))
        world.reset(np.array([0]), fast)
        assert world.exploded().all() == exploded


def test_quaternions_are_normalized(world: World) -> None:
    turn = from_rotvec(np.random.default_rng(6).normal(0, 0.4, (1, 15, 3)))
    pose = replace(upright(5.0), root_rotation=turn[:, 0], joints=turn[:, 1:])
    world.reset(np.array([0]), pose)
    wanted = world.states().rotations.copy()
    world.reset(np.array([0]), replace(pose, root_rotation=2 * turn[:, 0], joints=3 * turn[:, 1:]))
    np.testing.assert_allclose(world.states().rotations, wanted, atol=1e-12)


def test_indices_are_valid_integers(world: World) -> None:
    for wrong, error in (([0.0], TypeError), ([1], IndexError), ([2**32], IndexError)):
        with pytest.raises(error):
            world.reset(np.array(wrong), upright(1.0))
