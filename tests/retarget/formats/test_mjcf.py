"""The humanoid's MJCF in MuJoCo: Table 1's masses, joints and shapes, and a body that stands on the floor."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.rotations import from_euler
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.formats.mjcf import humanoid_mjcf
from kinemimic.retarget.humanoid.body import BODIES, STANDING_HEIGHT, TOTAL_MASS
from kinemimic.retarget.humanoid.limits import LIMITS
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.humanoid.surface import lowest_points
from kinemimic.train.sim.world import FRICTION, TIME_STEP


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(
        humanoid_mjcf(time_step=TIME_STEP, gravity=GRAVITY, friction=FRICTION)
    )


def test_masses_inertias_and_torques_are_those_of_table_1(model: mujoco.MjModel) -> None:
    assert sum(model.body_mass) == pytest.approx(TOTAL_MASS) == pytest.approx(48.2)
    assert model.nbody == 1 + len(BODIES) and model.njnt == 1 + 3 * 14 and model.nu == 3 * 14
    for body in BODIES:
        one = model.body(body.name)
        assert one.mass[0] == pytest.approx(body.mass)
        np.testing.assert_allclose(one.ipos, body.center, atol=1e-9)
        # MuJoCo may reorder the principal axes.
        np.testing.assert_allclose(sorted(one.inertia), sorted(body.inertia), rtol=1e-6)
        for axis in "xyz" if body.parent else "":
            motor = model.actuator(f"{body.node}_{axis}")
            np.testing.assert_allclose(motor.forcerange, [-body.torque_limit, body.torque_limit])
            np.testing.assert_allclose(motor.gainprm[0], body.stiffness)
            np.testing.assert_allclose(-motor.biasprm[1:3], [body.stiffness, body.damping])
    assert model.opt.timestep == pytest.approx(TIME_STEP)
    np.testing.assert_allclose(model.opt.gravity, [0, 0, -GRAVITY])


def test_ranges_are_those_of_the_joints_and_not_enforced(model: mujoco.MjModel) -> None:
    for node, limits in LIMITS.items():
        for axis, (least, most) in zip("xyz", limits, strict=True):
            joint = model.joint(f"{node}_{axis}")
            assert not joint.limited
            np.testing.assert_allclose(joint.range, [least, most], atol=1e-8)


def test_it_stands_as_high_as_ours_on_both_soles(model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.body("pelvis").xpos[2] == pytest.approx(STANDING_HEIGHT)
    # Soles at the floor's height: a millimetre lower, both are in contact, and nothing else.
    assert data.ncon == 0 or np.abs(data.contact.dist).max() < 1e-9
    data.joint("root").qpos[2] -= 1e-3
    mujoco.mj_forward(model, data)
    touching = {int(model.geom_bodyid[max(pair)]) for pair in data.contact.geom}
    assert touching == {model.body(f"foot_{side}").id for side in ("left", "right")}
    np.testing.assert_allclose(data.contact.dist, -1e-3, atol=1e-9)
    head = data.body("head")
    top = head.xpos[2] + 0.115 + 0.5 * 0.15
    assert top == pytest.approx(STANDING_HEIGHT + 0.075 + 0.40 + 0.19 - 1e-3)


def test_a_pose_has_our_joints_and_shapes(model: mujoco.MjModel) -> None:
    """Random angles: bodies and their lowest points are where `Motion` and `lowest_points` have them."""
    random = np.random.default_rng(3)
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (1, 20, 1))
    data = mujoco.MjData(model)
    for body in BODIES:
        angles = random.uniform(-0.9, 0.9, 3)
        node = NODE_INDEX[body.node]
        rotations[0, node] = from_euler(angles, "XYZ")
        if body.parent:
            for axis, angle in zip("xyz", angles, strict=True):
                data.joint(f"{body.node}_{axis}").qpos[0] = angle
    data.joint("root").qpos[:] = [0.3, -0.2, 1.4, *np.roll(rotations[0, 0], 1)]
    mujoco.mj_kinematics(model, data)
    root = np.array([[0.3, -0.2, 1.4]])
    motion = Motion(30.0, root, rotations, np.zeros((1, 2), dtype=bool), cyclic=False)
    positions, frames = motion.kinematics()
    lowest = lowest_points(positions, frames)[0]
    for k, body in enumerate(BODIES):
        np.testing.assert_allclose(data.body(body.name).xpos, positions[0, NODE_INDEX[body.node]], atol=1e-8)
        floor = model.geom("floor").id
        gap = mujoco.mj_geomDistance(model, data, floor, model.geom(body.name).id, 10.0, None)
        assert gap == pytest.approx(lowest[k, 2], abs=1e-6)


def test_it_steps_and_holds_its_pose(model: mujoco.MjModel) -> None:
    """For half a second towards the standing pose: it neither explodes, nor collapses, nor sinks in."""
    data = mujoco.MjData(model)
    for _ in range(round(0.5 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    assert np.isfinite(data.qpos).all()
    assert data.body("pelvis").xpos[2] == pytest.approx(STANDING_HEIGHT, abs=0.02)
    assert np.abs(data.qpos[7:]).max() < 0.2
    weight = sum(
        mujoco.mj_contactForce(model, data, k, force := np.zeros(6)) or force[0] for k in range(data.ncon)
    )
    assert weight == pytest.approx(TOTAL_MASS * GRAVITY, rel=0.2)
