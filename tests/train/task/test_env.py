from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.rotations import IDENTITY, from_rotvec, multiply
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import DomainRandomization, EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.pybullet_world import BulletWorld
from kinemimic.train.sim.world import SUBSTEPS, TIME_STEP
from kinemimic.train.task.domain_randomization import RandomizationSample, draw
from kinemimic.train.task.env import ACTION_SCALE, ACTIONS, ImitationBatch


def test_on_the_reference_nothing_is_left_to_correct(motion: Motion) -> None:
    """Right after a reset the terms are at their maximum, the drift is zero and the phase as given."""
    batch = ImitationBatch(BulletWorld(1), Reference(motion), EnvConfig())
    batch.reset(np.array([0]), np.array([0.25]))
    observation = batch.observe()[0]
    assert observation[0] == pytest.approx(1.0)
    assert observation[1] == pytest.approx(0.0, abs=1e-12)
    assert not batch.fallen()[0]
    step = batch.step(np.zeros((1, ACTIONS)))
    assert step.terms.sum() > 0.9
    assert batch.phases[0] == pytest.approx(0.25 + 1 / (30 * motion.duration))
    batch.world.close()


def test_targets_are_the_reference_at_every_substep_times_the_action(motion: Motion, puppets) -> None:
    world, reference = puppets(2), Reference(motion)
    batch = ImitationBatch(world, reference, EnvConfig(mirror=False))
    batch.reset(np.arange(2), np.array([0.2, 0.7]))
    actions = np.random.default_rng(1).normal(0, 0.5, (2, ACTIONS))
    batch.step(actions)
    for k, phase in enumerate((0.2, 0.7)):
        correction = from_rotvec((actions[k] * ACTION_SCALE).reshape(14, 3))
        for substep in range(SUBSTEPS):
            at = np.array([phase + (substep + 1) * TIME_STEP / reference.duration])
            wanted = multiply(reference.targets(at)[0][0], correction)
            np.testing.assert_allclose(world.targets[k, substep], wanted, atol=1e-13)


def test_feed_forward_switches_remove_their_part(motion: Motion, puppets) -> None:
    reference, phase, still = Reference(motion), np.array([0.2]), np.zeros((1, ACTIONS))

    def given(**switches: bool) -> tuple[np.ndarray, np.ndarray]:
        world = puppets(1)
        batch = ImitationBatch(world, reference, EnvConfig(**switches, mirror=False))
        batch.reset(np.arange(1), phase)
        batch.step(still)
        return world.targets[0], world.velocities[0]

    at = 0.2 + np.arange(1, SUBSTEPS + 1) * TIME_STEP / reference.duration
    joints, speeds = reference.joints(at)
    np.testing.assert_allclose(given(torque_feedforward=False)[0], joints, atol=1e-13)
    np.testing.assert_allclose(given()[1], speeds, atol=1e-13)
    np.testing.assert_array_equal(given(velocity_feedforward=False)[1], np.zeros_like(speeds))
    np.testing.assert_allclose(given(residual=False)[0], np.broadcast_to(IDENTITY, joints.shape), atol=1e-13)


def test_a_snapshot_continues_identically(motion: Motion, engine: str) -> None:
    """Two batches restored from one snapshot stay equal to the last bit, whatever came before."""
    random = np.random.default_rng(4)
    config = EnvConfig(
        domain_randomization=DomainRandomization(push=(20.0, 60.0), rest=(0.0, 0.1), delay=(0.004, 0.012))
    )

    def batch() -> ImitationBatch:
        return ImitationBatch(open_world(2, engine), Reference(motion), config)

    first, second = batch(), batch()
    randomization = RandomizationSample.concatenated(
        [draw(config.domain_randomization, 1.0, random) for _ in range(2)]
    )
    first.reset(np.arange(2), np.array([0.1, 0.6]), randomization)
    second.reset(np.arange(2), np.array([0.9, 0.3]))
    actions = random.normal(0, 0.1, (9, 2, ACTIONS))
    for k in range(4):
        first.step(actions[k])
        second.step(np.zeros((2, ACTIONS)))
    saved, seen = first.snapshot(), first.observe()
    for one in (first, second):
        one.restore(saved)
    np.testing.assert_allclose(first.observe(), seen, atol=1e-9)
    for k in range(4, 9):
        a, b = first.step(actions[k]), second.step(actions[k])
        np.testing.assert_array_equal(a.observations, b.observations)
        np.testing.assert_array_equal(a.terms, b.terms)
    for one in (first, second):
        one.world.close()


def test_a_delayed_action_follows_the_previous_one(motion: Motion, puppets) -> None:
    world, reference = puppets(2), Reference(motion)
    batch = ImitationBatch(world, reference, EnvConfig())
    late = replace(RandomizationSample.nominal(2), delay=np.array([0.0, 3.0]))
    batch.reset(np.arange(2), np.full(2, 0.2), late)
    one, other = (np.random.default_rng(k).normal(0, 0.3, (2, ACTIONS)) for k in (1, 2))
    batch.step(one)
    batch.step(other)
    at = batch.phases[0] + (np.arange(1, SUBSTEPS + 1) - SUBSTEPS) * TIME_STEP / reference.duration
    led = reference.targets(at)[0]
    for k, begins in ((0, 0), (1, 3)):
        turns = [from_rotvec((a[k] * ACTION_SCALE).reshape(14, 3)) for a in (one, other)]
        np.testing.assert_allclose(world.targets[k, :begins], multiply(led[:begins], turns[0]), atol=1e-12)
        np.testing.assert_allclose(world.targets[k, begins:], multiply(led[begins:], turns[1]), atol=1e-12)


def test_a_reset_clears_the_delayed_action(motion: Motion, puppets) -> None:
    """The last action of an episode does not act in the first steps of the next."""
    world, reference = puppets(2), Reference(motion)
    batch = ImitationBatch(world, reference, EnvConfig())
    late = replace(RandomizationSample.nominal(2), delay=np.full(2, 3.0))
    batch.reset(np.arange(2), np.full(2, 0.2), late)
    batch.step(np.full((2, ACTIONS), 0.3))
    batch.reset(
        np.array([1]), np.array([0.2]), replace(RandomizationSample.nominal(1), delay=np.full(1, 3.0))
    )
    at = batch.phases[:, None] + np.arange(1, SUBSTEPS + 1) * TIME_STEP / reference.duration
    batch.step(np.full((2, ACTIONS), 0.1))
    led = reference.targets(at)[0]
    np.testing.assert_allclose(world.targets[1, :3], led[1, :3], atol=1e-12)
    assert np.abs(world.targets[0, :3] - led[0, :3]).max() > 0.01


def test_the_preview_becomes_the_target_except_after_a_reset(motion: Motion, puppets) -> None:
    """It is not sampled again, and equals the reference at the current phases to the bit."""
    reference = Reference(motion)
    batch = ImitationBatch(puppets(3), reference, EnvConfig())
    batch.reset(np.arange(3), np.array([0.1, 0.5, 0.95]))
    for k in range(4):
        batch.step(np.zeros((3, ACTIONS)))
        if k == 1:
            batch.reset(np.array([1]), np.array([0.3]))
        np.testing.assert_array_equal(batch.target.rotations, reference.bodies(batch.phases).rotations)
        np.testing.assert_array_equal(batch.target.positions, reference.bodies(batch.phases).positions)


def test_an_exploded_humanoid_terminates_without_a_reward(motion: Motion, puppets) -> None:
    world, reference = puppets(3), Reference(motion)
    batch = ImitationBatch(world, reference, EnvConfig())
    batch.reset(np.arange(3), np.full(3, 0.4))
    ahead = reference.bodies(np.full(3, 0.4 + 1 / (30 * reference.duration)))
    # A step of the puppets leads one metre ahead: from here onto the reference.
    world.put(replace(ahead, positions=ahead.positions - np.array([1.0, 0.0, 0.0])))
    world.lost[1] = True
    step = batch.step(np.zeros((3, ACTIONS)))
    assert step.terminated.tolist() == step.exploded.tolist() == [False, True, False]
    assert not step.truncated.any()
    np.testing.assert_allclose(step.terms.sum(axis=1), [1.0, 0.0, 1.0], atol=1e-9)
    batch.reset(np.array([1]), np.array([0.4]))
    assert not world.exploded().any()
