"""Inverse dynamics against statics by hand, free fall, a pendulum and the engine."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    angle_between,
    conjugate,
    from_axis_angle,
    multiply,
    to_rotvec,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX, STANDING_HEIGHT, TOTAL_MASS
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.reference.dynamics import InverseDynamics, inverse_dynamics
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import SUBSTEPS

WEIGHT = TOTAL_MASS * GRAVITY


def held(height: float = STANDING_HEIGHT, **turns: float) -> Motion:
    """A humanoid that keeps a pose: node -> angle about its lateral axis, rad."""
    rotations = np.tile(IDENTITY, (10, len(NODES), 1))
    for node, angle in turns.items():
        rotations[:, NODE_INDEX[node]] = from_axis_angle("Y", angle)
    root = np.tile([0.0, 0.0, height], (10, 1))
    return Motion(30.0, root, rotations, np.zeros((10, 2), dtype=bool), cyclic=False)


def at_rest(motion: Motion, acceleration: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> InverseDynamics:
    bodies = Reference(motion).bodies(np.array([0.5]))
    rate = np.broadcast_to(np.array(acceleration), (1, 15, 3))
    return inverse_dynamics(bodies, rate, np.zeros((1, 15, 3)))


def of(found: InverseDynamics, body: str) -> np.ndarray:
    return found.torques[0, BODY_INDEX[body] - 1]


def test_standing_loads_both_feet_equally() -> None:
    found = at_rest(held())
    np.testing.assert_allclose(found.ground[0], [0.0, 0.0, WEIGHT], atol=1.0)
    assert np.abs(found.missing).max() < 1.0
    left, right = of(found, "foot_left"), of(found, "foot_right")
    np.testing.assert_allclose(left[1], right[1], atol=0.5)
    np.testing.assert_allclose(left[0], -right[0], atol=0.5)
    # All but the feet stands straight over the ankles: they turn it neither forward nor back.
    assert left[1] + right[1] == pytest.approx(0.0, abs=0.5)


def test_a_raised_arm_needs_its_weight_times_its_lever_arm() -> None:
    """1.6, 1.0 and 0.8 kg at 0.15, 0.425 and 0.59 m from the shoulder; from the elbow 0.125 and 0.29 m."""
    found = at_rest(held(height=3.0, shoulder_left=-np.pi / 2))
    shoulder = GRAVITY * (1.6 * 0.15 + 1.0 * 0.425 + 0.8 * 0.59)
    elbow = GRAVITY * (1.0 * 0.125 + 0.8 * 0.29)
    # Turned forward and up it is held against gravity by a torque about -Y, the way that it was lifted.
    np.testing.assert_allclose(of(found, "upper_arm_left"), [0.0, -shoulder, 0.0], atol=1e-9)
    np.testing.assert_allclose(of(found, "forearm_left"), [0.0, -elbow, 0.0], atol=1e-9)
    np.testing.assert_allclose(of(found, "upper_arm_right"), 0.0, atol=1e-9)


def test_free_fall_needs_no_torque_and_no_ground_force() -> None:
    found = at_rest(held(height=3.0, hip_left=-0.7, knee_left=1.0), acceleration=(0.0, 0.0, -GRAVITY))
    for part in (found.torques, found.ground, found.missing):
        np.testing.assert_allclose(part, 0.0, atol=1e-9)


def test_the_residual_force_is_at_the_root() -> None:
    """In the air, held up by nothing."""
    found = at_rest(held(height=3.0))
    np.testing.assert_allclose(found.missing[0, :3], [0.0, 0.0, WEIGHT], atol=1e-9)


def test_the_ground_does_not_pull() -> None:
    found = at_rest(held(), acceleration=(0.0, 0.0, -2 * GRAVITY))
    np.testing.assert_allclose(found.ground, 0.0, atol=1e-9)
    np.testing.assert_allclose(found.missing[0, 2], -WEIGHT, atol=1e-9)


def test_the_ground_pushes_within_its_friction() -> None:
    """For a sideways acceleration of 1 g it gives at most 0.9 of the weight."""
    found = at_rest(held(), acceleration=(0.0, GRAVITY, 0.0))
    sideways, up = np.hypot(*found.ground[0, :2]), found.ground[0, 2]
    assert 0.0 < sideways <= 0.9 * up * (1 + 1e-9)


def test_the_feed_forward_makes_the_engine_hold_a_pose(engine: str) -> None:
    """One arm out, pelvis held: the arm sags without the lead and stays with it."""
    reference, world = Reference(held(height=3.0, shoulder_left=-np.pi / 2)), open_world(1, engine)
    joint, start = BODY_INDEX["upper_arm_left"] - 1, np.zeros(1)
    wanted, speeds = reference.joints(start)
    carried = np.zeros((1, 15, 6))
    carried[0, 0, 2] = WEIGHT
    sag = []
    for rotations in (wanted, reference.targets(start)[0]):
        targets = np.repeat(rotations[:, None], SUBSTEPS, axis=1)
        world.reset(np.array([0]), reference.poses(start))
        for _ in range(15):
            states = world.step(targets, np.repeat(speeds[:, None], SUBSTEPS, axis=1), carried)
        sag.append(float(angle_between(states.joints[0, joint], wanted[0, joint])))
    world.close()
    assert sag[0] > 0.01
    assert sag[1] < 0.5 * sag[0]


def test_targets_lead_within_torque_limits_and_are_periodic(motion: Motion) -> None:
    """By at most 0.7 of a joint's torque limit over its stiffness; the same in every cycle."""
    reference, phases = Reference(motion), np.linspace(0.0, 1.0, 50)
    targets, speeds = reference.targets(phases)
    joints = reference.joints(phases)
    np.testing.assert_allclose(targets, reference.targets(phases + 3.0)[0], atol=1e-9)
    np.testing.assert_array_equal(speeds, joints[1])
    lead = to_rotvec(multiply(conjugate(joints[0]), targets))
    most = np.array([0.7 * body.torque_limit / body.stiffness for body in BODIES[1:]])
    assert (np.abs(lead).max(axis=(0, 2)) <= most * 1.01).all()
    assert np.abs(lead).max() > 0.02


def test_a_pose_held_at_the_end_needs_static_torques() -> None:
    """The last frame is held for ever, without deceleration into it."""
    reference = Reference(held(shoulder_left=-np.pi / 2))
    shoulder = GRAVITY * (1.6 * 0.15 + 1.0 * 0.425 + 0.8 * 0.59)
    for phase in (0.0, 0.5, 1.0, 1.7):
        at = np.array([phase])
        lead = to_rotvec(multiply(conjugate(reference.joints(at)[0]), reference.targets(at)[0]))
        arm = lead[0, BODY_INDEX["upper_arm_left"] - 1]
        np.testing.assert_allclose(arm, [0.0, -shoulder / 400.0, 0.0], atol=1e-4)
