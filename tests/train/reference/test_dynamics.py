"""Inverse dynamics against statics by hand, free fall, a pendulum, a spinning body and the engine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    angle_between,
    conjugate,
    from_axis_angle,
    from_rotvec,
    multiply,
    rotate,
    to_matrix,
    to_rotvec,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX, BODY_MASSES, STANDING_HEIGHT, TOTAL_MASS
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.reference.dynamics import InverseDynamics, inverse_dynamics
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import SUBSTEPS, BodyStates

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


# Of the straight arm: kg, distances from shoulder and elbow in m, and the own moments of inertia about the
# lateral axis in kg·m², m/5 of the squared semi-axes of an ellipsoid (Table 1).
ARM_MASS = np.array([1.6, 1.0, 0.8])
FROM_SHOULDER, FROM_ELBOW = np.array([0.15, 0.425, 0.59]), np.array([0.0, 0.125, 0.29])
ARM_INERTIA = np.array([0.32 * (0.05**2 + 0.15**2), 0.2 * (0.04**2 + 0.125**2), 0.16 * (0.04**2 + 0.04**2)])


def swinging(angle: float, speed: float, acceleration: float) -> InverseDynamics:
    """The straight left arm turns about the lateral axis through its shoulder, and nothing else moves.

    angle: rad from hanging, about +Y (backward).
    """
    bodies = Reference(held(height=3.0, shoulder_left=angle)).bodies(np.array([0.5]))
    arm = [BODY_INDEX[f"{name}_left"] for name in ("upper_arm", "forearm", "hand")]
    along = np.array([-np.sin(angle), 0.0, -np.cos(angle)])
    ahead = np.array([-np.cos(angle), 0.0, np.sin(angle)])  # the way that an angle grows
    angular, turning, rate = np.zeros((3, 1, 15, 3))
    angular[0, arm, 1], turning[0, arm, 1] = speed, acceleration
    rate[0, arm] = FROM_SHOULDER[:, None] * (acceleration * ahead - speed**2 * along)
    linear = np.zeros((1, 15, 3))
    linear[0, arm] = FROM_SHOULDER[:, None] * speed * ahead
    return inverse_dynamics(BodyStates(bodies.positions, bodies.rotations, linear, angular), rate, turning)


@pytest.mark.parametrize("angle", [-1.4, -0.3, 0.0, 0.8])
def test_a_swinging_arm_needs_its_inertia_times_its_acceleration(angle: float) -> None:
    """About the shoulder (I + m r²) α + m g r sin θ; about the elbow, at which the arm moves as one, the same
    with the products of both distances."""
    speed, acceleration = 3.0, 7.0
    found = swinging(angle, speed, acceleration)
    shoulder = float((ARM_INERTIA + ARM_MASS * FROM_SHOULDER**2).sum()) * acceleration
    shoulder += GRAVITY * float((ARM_MASS * FROM_SHOULDER).sum()) * np.sin(angle)
    elbow = float((ARM_INERTIA + ARM_MASS * FROM_ELBOW * FROM_SHOULDER)[1:].sum()) * acceleration
    elbow += GRAVITY * float((ARM_MASS * FROM_ELBOW).sum()) * np.sin(angle)
    np.testing.assert_allclose(of(found, "upper_arm_left"), [0.0, shoulder, 0.0], atol=1e-9)
    np.testing.assert_allclose(of(found, "forearm_left"), [0.0, elbow, 0.0], atol=1e-9)


def test_a_pendulum_swings_by_itself() -> None:
    """α = -m g r sin θ / (I + m r²) needs no torque at the shoulder, however fast the arm is."""
    angle = 0.9
    inertia = (ARM_INERTIA + ARM_MASS * FROM_SHOULDER**2).sum()
    acceleration = -GRAVITY * float((ARM_MASS * FROM_SHOULDER).sum() / inertia) * np.sin(angle)
    for speed in (0.0, 4.0):
        np.testing.assert_allclose(of(swinging(angle, speed, acceleration), "upper_arm_left"), 0.0, atol=1e-9)


def test_a_spinning_foot_needs_the_torque_of_eulers_equations() -> None:
    """A box of 0.16, 0.07 and 0.05 m and 1.2 kg that falls freely and turns by (1, 2, 3) rad/s in its own
    axes: I = (0.00074, 0.00281, 0.00305) kg·m² and ω x Iω = (0.00144, -0.00693, 0.00414) N·m."""
    bodies = Reference(held(height=3.0, hip_left=-0.7, knee_left=1.1)).bodies(np.array([0.5]))
    foot = BODY_INDEX["foot_left"]
    angular = np.zeros((1, 15, 3))
    angular[0, foot] = rotate(bodies.rotations[0, foot], np.array([1.0, 2.0, 3.0]))
    spinning = BodyStates(bodies.positions, bodies.rotations, np.zeros((1, 15, 3)), angular)
    fall = np.broadcast_to([0.0, 0.0, -GRAVITY], (1, 15, 3))
    found = inverse_dynamics(spinning, fall, np.zeros((1, 15, 3)))
    np.testing.assert_allclose(of(found, "foot_left"), [0.00144, -0.00693, 0.00414], atol=1e-9)
    np.testing.assert_allclose(found.missing[0, :3], 0.0, atol=1e-9)


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


STEP = 1.0 / 240.0  # s between the states whose differences are the accelerations


def moving(motion: Motion, lift: float = 0.0) -> tuple[BodyStates, Array, Array]:
    """Bodies at 20 moments of a motion whose trunk and arms turn about all axes in addition, with their
    accelerations and angular accelerations."""
    turn = 2.0 * np.pi * np.arange(len(motion.root)) / len(motion.root)
    rotations = motion.rotations.copy()
    for node, vector in (
        ("hip_center", [0.05, 0.08, 0.15]),
        ("spine", [0.1, -0.2, 0.3]),
        ("shoulder_left", [0.9, 0.5, -0.4]),
        ("elbow_right", [0.0, -0.8, 0.3]),
    ):
        swing = from_rotvec(np.outer(np.sin(turn + vector[2]), vector))
        rotations[:, NODE_INDEX[node]] = multiply(rotations[:, NODE_INDEX[node]], swing)
    reference, at = Reference(replace(motion, rotations=rotations)), np.linspace(0.05, 0.95, 20)
    before, now, after = (reference.bodies(at + s * STEP / reference.duration) for s in (-1.0, 0.0, 1.0))
    lifted = BodyStates(now.positions + np.array([0.0, 0.0, lift]), now.rotations, now.linear, now.angular)
    rates = [getattr(after, name) - getattr(before, name) for name in ("linear", "angular")]
    return lifted, rates[0] / (2.0 * STEP), rates[1] / (2.0 * STEP)


def inertia(bodies: BodyStates) -> Array:
    """Inertia tensors (T, 15, 3, 3) in the world of solid boxes and ellipsoids, by their integrals of x²."""
    squares = np.array(
        [np.square(body.size) * body.mass / (12.0 if body.shape == "box" else 20.0) for body in BODIES]
    )
    matrix = to_matrix(bodies.rotations)
    moment = np.einsum("tbij,bj,tbkj->tbik", matrix, squares, matrix)
    trace = np.trace(moment, axis1=-2, axis2=-1)
    return np.asarray(trace[..., None, None] * np.eye(3) - moment)


def test_ground_and_missing_force_are_the_mass_times_the_acceleration_with_gravity(motion: Motion) -> None:
    bodies, rate, turning = moving(motion)
    found = inverse_dynamics(bodies, rate, turning)
    wanted = np.einsum("b,tbi->ti", BODY_MASSES, rate + np.array([0.0, 0.0, GRAVITY]))
    np.testing.assert_allclose(found.ground + found.missing[:, :3], wanted, atol=1e-9)
    assert (found.ground[:, 2] > 0.5 * WEIGHT).sum() > 10


def test_the_ground_pushes_where_the_soles_are(motion: Motion) -> None:
    """The moment that is not missing is that of the ground: it gives the point at which the ground's force
    acts, up to the height of the corners that bear it, at most 4.5 cm."""
    bodies, rate, turning = moving(motion)
    found = inverse_dynamics(bodies, rate, turning)
    flying = BodyStates(bodies.positions + np.array([0, 0, 5.0]), *list(vars(bodies).values())[1:])
    moment = inverse_dynamics(flying, rate, turning).missing[:, 3:] - found.missing[:, 3:]
    borne = found.ground[:, 2] > 0.5 * WEIGHT
    assert borne.sum() > 10
    force, root, moment = found.ground[borne], bodies.positions[borne, 0], moment[borne]
    lever = np.stack([-moment[:, 1] - root[:, 2] * force[:, 0], moment[:, 0] - root[:, 2] * force[:, 1]])
    point = root[:, :2] + (lever / force[:, 2]).T
    feet = [BODY_INDEX["foot_left"], BODY_INDEX["foot_right"]]
    corners = np.array([[a * 0.08, b * 0.035, -0.025] for a in (-1, 1) for b in (-1, 1)])
    soles = bodies.positions[:, feet, None] + rotate(bodies.rotations[:, feet, None], corners)
    low = np.where(soles[..., 2:] < 0.045, soles[..., :2], np.nan)[borne].reshape(len(root), -1, 2)
    assert (point > np.nanmin(low, axis=1) - 0.045).all()
    assert (point < np.nanmax(low, axis=1) + 0.045).all()


def test_the_missing_moment_in_the_air_is_the_rate_of_the_angular_momentum(motion: Motion) -> None:
    """About the pelvis' centre, which is the root's joint: r x m (a + g), and d(J ω)/dt = J α + ω x J ω with
    the inertia tensors J in the world."""
    bodies, rate, turning = moving(motion, lift=5.0)
    found = inverse_dynamics(bodies, rate, turning)
    tensors = inertia(bodies)
    own = np.einsum("tbij,tbj->tbi", tensors, turning)
    own += np.cross(bodies.angular, np.einsum("tbij,tbj->tbi", tensors, bodies.angular))
    arms = bodies.positions - bodies.positions[:, :1]
    weights = BODY_MASSES[:, None] * (rate + np.array([0.0, 0.0, GRAVITY]))
    np.testing.assert_allclose(found.missing[:, 3:], (own + np.cross(arms, weights)).sum(axis=1), atol=1e-9)
    np.testing.assert_allclose(found.ground, 0.0, atol=0.0)


@pytest.mark.parametrize(("lift", "yaw"), [(5.0, 0.7), (0.0, 0.5 * np.pi)])
def test_a_turn_about_the_vertical_turns_the_forces_and_keeps_the_torques(
    motion: Motion, lift: float, yaw: float
) -> None:
    """On the ground by a quarter: the friction cones have four edges."""
    bodies, rate, turning = moving(motion, lift)
    turn = from_axis_angle("Z", yaw)
    turned = BodyStates(
        rotate(turn, bodies.positions),
        multiply(turn, bodies.rotations),
        rotate(turn, bodies.linear),
        rotate(turn, bodies.angular),
    )
    was, found = (
        inverse_dynamics(bodies, rate, turning),
        inverse_dynamics(turned, rotate(turn, rate), rotate(turn, turning)),
    )
    np.testing.assert_allclose(found.torques, was.torques, atol=1e-6)
    np.testing.assert_allclose(found.ground, rotate(turn, was.ground), atol=1e-6)
    for part in (slice(0, 3), slice(3, 6)):
        np.testing.assert_allclose(found.missing[:, part], rotate(turn, was.missing[:, part]), atol=1e-6)


def test_the_mirror_image_has_the_mirrored_forces_and_torques(motion: Motion) -> None:
    """In the plane y = 0: vectors change their y, moments and turns their x and z, and the sides exchange."""
    bodies, rate, turning = moving(motion)
    other = [BODY_INDEX[body.name.replace("left", "*").replace("right", "left").replace("*", "right")]
             for body in BODIES]  # fmt: skip
    vector, axial = np.array([1.0, -1.0, 1.0]), np.array([-1.0, 1.0, -1.0])
    image = BodyStates(
        (vector * bodies.positions)[:, other],
        (np.array([*axial, 1.0]) * bodies.rotations)[:, other],
        (vector * bodies.linear)[:, other],
        (axial * bodies.angular)[:, other],
    )
    was = inverse_dynamics(bodies, rate, turning)
    found = inverse_dynamics(image, (vector * rate)[:, other], (axial * turning)[:, other])
    joints = np.array(other[1:]) - 1
    np.testing.assert_allclose(found.torques, (axial * was.torques)[:, joints], atol=1e-6)
    np.testing.assert_allclose(found.ground, vector * was.ground, atol=1e-6)
    np.testing.assert_allclose(found.missing, np.concatenate([vector, axial]) * was.missing, atol=1e-6)
