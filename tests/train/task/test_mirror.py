"""A humanoid and its mirror image half a cycle later: same observation, mirrored action."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.rotations import from_axis_angle, from_rotvec, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.humanoid.body import BODY_NAMES
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE, SUBSTEPS, TIME_STEP, Poses
from kinemimic.train.task.domain_randomization import RandomizationSample
from kinemimic.train.task.env import ACTION_SCALE, ACTIONS, ImitationBatch
from kinemimic.train.task.mirror import (
    AXIS,
    COUNTERPARTS,
    JOINT_COUNTERPARTS,
    MAX_ASYMMETRY,
    QUATERNION,
    VECTOR,
    Mirror,
    asymmetry,
)
from kinemimic.train.task.observation import observation_size


class Held:
    """Randomization that sets given initial poses."""

    def __init__(self, poses: Poses) -> None:
        self._calm = RandomizationSample.nominal(len(poses.root))
        self._poses = poses

    def __getattr__(self, name: str) -> object:
        return getattr(self._calm, name)

    def perturbed(self, _: Poses) -> Poses:
        return self._poses


def reflected(poses: Poses) -> Poses:
    joints = JOINT_COUNTERPARTS
    return Poses(
        root=poses.root * VECTOR,
        root_rotation=poses.root_rotation * QUATERNION,
        root_linear=poses.root_linear * VECTOR,
        root_angular=poses.root_angular * AXIS,
        joints=poses.joints[:, joints] * QUATERNION,
        joint_velocities=poses.joint_velocities[:, joints] * AXIS,
    )


def shaken(motion: Motion, phase: float) -> Poses:
    """The reference at a phase, off it in everything; the same for one phase and the next cycle's."""
    rng = np.random.default_rng(5)
    poses = Reference(motion).poses(np.array([phase]))
    turns = from_axis_angle("Y", rng.normal(0.0, 0.1, poses.joints.shape[:2]))
    tilt = multiply(from_axis_angle("X", np.array([0.1])), from_axis_angle("Z", np.array([0.3])))
    return Poses(
        root=poses.root + rng.normal(0.0, 0.02, (1, 3)) + np.array([0.0, 0.0, 0.05]),
        root_rotation=multiply(tilt, poses.root_rotation),
        root_linear=poses.root_linear + rng.normal(0.0, 0.3, (1, 3)),
        root_angular=poses.root_angular + rng.normal(0.0, 0.3, (1, 3)),
        joints=multiply(poses.joints, turns),
        joint_velocities=poses.joint_velocities + rng.normal(0.0, 0.3, poses.joint_velocities.shape),
    )


def pair(
    motion: Motion, engine: str, config: EnvConfig, phase: float = 0.2, lift: float = 0.0
) -> ImitationBatch:
    """A humanoid in the first half of a cycle, and its mirror image half a cycle later."""
    batch = ImitationBatch(open_world(2, engine), Reference(motion), config)
    one = shaken(motion, phase)
    one = replace(one, root=one.root + np.array([0.0, 0.0, lift]))
    other = reflected(one)
    half = np.array([0.5 * motion.cycle_offset[0], 0.0, 0.0])
    both = Poses(**{
        name: np.concatenate([value, getattr(other, name) + (half if name == "root" else 0.0)])
        for name, value in vars(one).items()
    })  # fmt: skip
    batch.reset(np.arange(2), np.array([phase, phase + 0.5]), Held(both))  # type: ignore[arg-type]
    return batch


@pytest.mark.parametrize("phase", [-1.8, 0.0, 0.2, 1.49])
@pytest.mark.parametrize("preview", [(1,), (1, 4, 12)])
def test_the_mirror_image_has_the_same_observation(
    motion: Motion, preview: tuple[int, ...], phase: float
) -> None:
    batch = pair(motion, "pybullet", EnvConfig(preview=preview), phase)
    left, right = batch.observe()
    assert np.abs(left).max() > 0.5
    np.testing.assert_allclose(right, left, atol=1e-6)
    batch.world.close()
    plain = pair(motion, "pybullet", EnvConfig(preview=preview, mirror=False), phase)
    np.testing.assert_array_equal(plain.observe()[0], left)
    assert np.abs(plain.observe()[1] - left).max() > 0.5
    plain.world.close()


def test_the_mirror_image_gets_the_mirrored_action(motion: Motion, engine: str) -> None:
    """Without a mirror the same correction would bend the other leg. High in the air: contacts are solved one
    after the other, not in a mirror."""
    batch = pair(motion, engine, EnvConfig(), lift=0.4)
    action = np.random.default_rng(2).normal(0.0, 0.2, ACTIONS)
    given = np.tile(action, (2, 1))
    for _ in range(3):
        left, right = batch.step(given).observations
    np.testing.assert_allclose(right, left, rtol=1e-7, atol=1e-7)
    np.testing.assert_array_equal(given[1], action)  # the caller's own is not changed
    assert np.abs(batch.bodies.rotations[1] - batch.bodies.rotations[0]).max() > 0.05
    batch.world.close()


def test_a_delayed_action_keeps_the_mirroring_of_its_time(motion: Motion, puppets) -> None:
    """An action of the first half, delayed into the second, is not mirrored."""
    world, reference = puppets(1), Reference(motion)
    batch = ImitationBatch(world, reference, EnvConfig())
    late = replace(RandomizationSample.nominal(1), delay=np.array([3.0]))
    step = 1.0 / (CONTROL_RATE * motion.duration)
    batch.reset(np.array([0]), np.array([0.5 - 0.5 * step]), late)
    first, second = np.random.default_rng(3).normal(0.0, 0.3, (2, 1, ACTIONS))
    batch.step(first)
    batch.step(second)
    image = second.copy()
    Mirror(EnvConfig()).actions(image, np.array([True]))
    begins = 0.5 + 0.5 * step
    for substep in range(SUBSTEPS):
        at = np.array([begins + (substep + 1) * TIME_STEP / reference.duration])
        turn = from_rotvec(((first if substep < 3 else image)[0] * ACTION_SCALE).reshape(-1, 3))
        wanted = multiply(reference.targets(at)[0][0], turn)
        np.testing.assert_allclose(world.targets[0, substep], wanted, atol=1e-12)


def test_reflecting_twice_is_the_identity() -> None:
    rng = np.random.default_rng(0)
    config = EnvConfig(preview=(1, 4), observed_obstacles=2)
    mirror, rows = Mirror(config), np.array([True, False, True])
    size = observation_size(config)
    observations, actions = rng.normal(size=(3, size)), rng.normal(size=(3, ACTIONS))
    for values, change in ((observations, mirror.observations), (actions, mirror.actions)):
        before = values.copy()
        change(values, rows)
        np.testing.assert_array_equal(values[1], before[1])
        assert (values[[0, 2]] != before[[0, 2]]).any(axis=1).all()
        change(values, rows)
        np.testing.assert_array_equal(values, before)


def test_left_and_right_are_swapped() -> None:
    names = np.array(BODY_NAMES)
    assert names[COUNTERPARTS][names == "foot_left"] == ["foot_right"]
    assert names[COUNTERPARTS][names == "torso"] == ["torso"]
    assert (VECTOR * AXIS == [-1.0, -1.0, -1.0]).all()  # an axis is a vector that the mirror turns round


def limping(motion: Motion, angle: float) -> Motion:
    """With the left hip always abducted by an angle, each thigh differs from its image by it."""
    rotations, hip = motion.rotations.copy(), NODE_INDEX["hip_left"]
    rotations[:, hip] = multiply(rotations[:, hip], from_axis_angle("X", np.full(len(rotations), angle)))
    return replace(motion, rotations=rotations)


def test_asymmetry_is_the_mean_over_thighs_shins_and_feet(motion: Motion) -> None:
    assert asymmetry(Reference(motion)) < 1e-3
    assert asymmetry(Reference(limping(motion, 0.3))) == pytest.approx(2 * 0.3 / 6, abs=2e-3)


def test_asymmetric_or_non_cyclic_motions_are_not_mirrored(motion: Motion, puppets) -> None:
    """At phase 0.7 of a cycle the sine is negative; reflected, half a cycle away, it is not."""
    once = replace(motion, cyclic=False, cycle_offset=np.zeros(3))
    for moves, sine in (
        (motion, np.sin(0.4 * np.pi)),
        (limping(motion, 2.5 * MAX_ASYMMETRY), np.sin(0.4 * np.pi)),
        (limping(motion, 3.5 * MAX_ASYMMETRY), np.sin(1.4 * np.pi)),
        (once, np.sin(0.7 * np.pi)),
    ):
        batch = ImitationBatch(puppets(1), Reference(moves), EnvConfig())
        batch.reset(np.array([0]), np.array([0.7]))
        assert batch.observe()[0, 0] == pytest.approx(sine)
