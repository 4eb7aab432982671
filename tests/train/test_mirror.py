"""A figure, and the same figure in a mirror half a cycle later: seen alike, and answered alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.rotations import from_axis_angle, multiply
from kinemimic.pipeline.skeleton import NODE_INDEX
from kinemimic.retarget.body import BODY_NAMES
from kinemimic.retarget.motion import Motion
from kinemimic.train.config import EnvConfig
from kinemimic.train.engines import open_world
from kinemimic.train.env import ACTIONS, ImitationBatch
from kinemimic.train.hardship import Conditions
from kinemimic.train.mirror import ALIKE, BODIES, Mirror, asymmetry
from kinemimic.train.reference import Reference
from kinemimic.train.world import Poses

TURNED_ABOUT = np.array([1.0, -1.0, 1.0, -1.0])  # a rotation as a mirror at y = 0 shows it
VECTOR, AXIS = np.array([1.0, -1.0, 1.0]), np.array([-1.0, 1.0, -1.0])


class Held:
    """Conditions that put figures at poses of a test's own."""

    def __init__(self, poses: Poses) -> None:
        self._calm = Conditions.calm(len(poses.root))
        self._poses = poses

    def __getattr__(self, name: str) -> object:
        return getattr(self._calm, name)

    def disturbed(self, _: Poses) -> Poses:
        return self._poses


def reflected(poses: Poses) -> Poses:
    joints = BODIES[1:] - 1
    return Poses(
        root=poses.root * VECTOR,
        root_rotation=poses.root_rotation * TURNED_ABOUT,
        root_linear=poses.root_linear * VECTOR,
        root_angular=poses.root_angular * AXIS,
        joints=poses.joints[:, joints] * TURNED_ABOUT,
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


def pair(motion: Motion, engine: str, config: EnvConfig) -> ImitationBatch:
    """A figure a fifth through the cycle, and its mirror image half a cycle on."""
    batch = ImitationBatch(open_world(2, engine), Reference(motion), config)
    one = shaken(motion, 0.2)
    other = reflected(one)
    half = np.array([0.5 * motion.cycle_offset[0], 0.0, 0.0])
    both = Poses(**{
        name: np.concatenate([value, getattr(other, name) + (half if name == "root" else 0.0)])
        for name, value in vars(one).items()
    })  # fmt: skip
    batch.reset(np.arange(2), np.array([0.2, 0.7]), Held(both))  # type: ignore[arg-type]
    return batch


@pytest.mark.parametrize("preview", [(1,), (1, 4, 12)])
def test_the_mirror_image_is_seen_alike(motion: Motion, engine: str, preview: tuple[int, ...]) -> None:
    batch = pair(motion, engine, EnvConfig(preview=preview))
    left, right = batch.observe()
    assert np.abs(left).max() > 0.5
    np.testing.assert_allclose(right, left, atol=1e-6)
    batch.world.close()
    plain = pair(motion, engine, EnvConfig(preview=preview, mirror=False))
    left, right = plain.observe()
    assert np.abs(right - left).max() > 0.5
    plain.world.close()


def test_it_is_answered_alike(motion: Motion, engine: str) -> None:
    """Without a mirror the same correction would bend the other leg."""
    batch = pair(motion, engine, EnvConfig())
    action = np.random.default_rng(2).normal(0.0, 0.2, ACTIONS)
    given = np.tile(action, (2, 1))
    for _ in range(3):  # in the air: contacts are solved one after the other, not in a mirror
        left, right = batch.step(given).observations
    np.testing.assert_allclose(right, left, rtol=1e-3, atol=1e-4)
    np.testing.assert_array_equal(given[1], action)  # the caller's own is not changed
    assert np.abs(batch.bodies.rotations[1] - batch.bodies.rotations[0]).max() > 0.05
    batch.world.close()


def test_twice_through_the_mirror_is_not_at_all() -> None:
    rng = np.random.default_rng(0)
    mirror, rows = Mirror(previews=2), np.array([True, False, True])
    observations, actions = rng.normal(size=(3, 225 + 3 * 15 + 2 + 47)), rng.normal(size=(3, ACTIONS))
    for values, change in ((observations, mirror.observations), (actions, mirror.actions)):
        before = values.copy()
        change(values, rows)
        np.testing.assert_array_equal(values[1], before[1])
        assert (values[[0, 2]] != before[[0, 2]]).any(axis=1).all()
        change(values, rows)
        np.testing.assert_array_equal(values, before)


def test_left_and_right_change_places() -> None:
    names = np.array(BODY_NAMES)
    assert names[BODIES][names == "foot_left"] == ["foot_right"]
    assert names[BODIES][names == "torso"] == ["torso"]


def test_who_limps_or_does_it_once_is_not_mirrored(motion: Motion, engine: str) -> None:
    assert asymmetry(Reference(motion)) < 1e-3
    rotations = motion.rotations.copy()
    hip = NODE_INDEX["hip_left"]
    rotations[:, hip] = multiply(rotations[:, hip], from_axis_angle("X", np.full(len(rotations), 0.3)))
    limp = Reference(replace(motion, rotations=rotations))
    # Either thigh's image is off by 0.3 rad, of two thighs, two shins and two feet.
    assert asymmetry(limp) == pytest.approx(2 * 0.3 / 6, abs=2e-3)
    once = Reference(replace(motion, cyclic=False, cycle_offset=np.zeros(3)))
    assert asymmetry(once) > ALIKE
    batch = ImitationBatch(open_world(1, engine), once, EnvConfig())
    batch.reset(np.array([0]), np.array([0.7]))
    assert batch.observe()[0, 0] == pytest.approx(np.sin(0.7 * np.pi))
    batch.world.close()
