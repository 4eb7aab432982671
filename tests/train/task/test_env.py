from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from peers.elsewhere import turned

from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    conjugate,
    from_axis_angle,
    from_rotvec,
    multiply,
    normalize,
    rotate,
    to_6d,
    to_rotvec,
)
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import DomainRandomization, EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.pybullet_world import BulletWorld
from kinemimic.train.sim.world import SUBSTEPS, TIME_STEP, BodyStates
from kinemimic.train.task.domain_randomization import RandomizationSample, draw
from kinemimic.train.task.env import ACTION_SCALE, ACTIONS, OBSERVATIONS, ImitationBatch, observation_size


def test_observation_does_not_depend_on_the_heading(motion: Motion) -> None:
    """It is in the humanoid's heading: rotating world and reference together changes nothing."""
    found = []
    for angle in (0.0, 2.0):
        batch = ImitationBatch(BulletWorld(2), Reference(turned(motion, angle)), EnvConfig())
        batch.reset(np.arange(2), np.array([0.2, 0.7]))
        found.append(batch.observe())
        batch.world.close()
    assert found[0].shape == (2, OBSERVATIONS)
    np.testing.assert_allclose(found[0], found[1], atol=1e-5)


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


def scattered(reference: Reference, phases: np.ndarray) -> BodyStates:
    """Bodies near the reference, with different errors for each humanoid."""
    bodies = reference.bodies(phases)
    size = (len(phases), 15, 3)
    near = np.random.default_rng(0).normal
    return BodyStates(
        bodies.positions + near(0, 0.05, size),
        normalize(bodies.rotations + near(0, 0.1, (*size[:2], 4))),
        bodies.linear + near(0, 1.0, size),
        bodies.angular + near(0, 1.0, size),
    )


def test_observation_equals_its_parts(motion: Motion, puppets) -> None:
    """Recomputed per humanoid with the rotations of the pipeline."""
    reference, phases = Reference(motion), np.array([0.1, 0.55, 1.8])
    world = puppets(3)
    batch = ImitationBatch(world, reference, EnvConfig(mirror=False))
    states = scattered(reference, phases)
    world.put(states)
    batch.phases[:] = phases
    batch.reset(np.array([], dtype=np.intp), np.array([]))
    ahead = reference.bodies(phases + 1 / (30 * reference.duration))
    for k, found in enumerate(batch.observe()):
        pelvis = states.positions[k, 0]
        forward = rotate(states.rotations[k, 0], np.array([1.0, 0.0, 0.0]))
        level = from_axis_angle("Z", -np.arctan2(forward[1], forward[0]))
        wanted = [
            [np.sin(2 * np.pi * phases[k]), np.cos(2 * np.pi * phases[k]), pelvis[2]],
            to_6d(multiply(level, states.rotations[k])),
            rotate(level, states.positions[k, 1:] - pelvis),
            rotate(level, states.linear[k]),
            rotate(level, states.angular[k]),
            to_rotvec(multiply(conjugate(states.rotations[k, 0]), ahead.rotations[k, 0])),
            to_rotvec(multiply(conjugate(states.joints[k]), ahead.joints[k])),
            rotate(level, ahead.positions[k, 0] - pelvis)[:2],
        ]
        np.testing.assert_allclose(found, np.concatenate([np.ravel(part) for part in wanted]), atol=1e-12)


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


def test_each_preview_equals_a_preview_of_one_step(motion: Motion, puppets) -> None:
    """The previews of 1 and of 4 steps together are the preview of both."""
    reference, states = Reference(motion), scattered(Reference(motion), np.array([0.2]))

    def seen(preview: tuple[int, ...]) -> np.ndarray:
        world, config = puppets(1), EnvConfig(preview=preview)
        batch = ImitationBatch(world, reference, config)
        world.put(states)
        batch.phases[:] = 0.2
        batch.reset(np.array([], dtype=np.intp), np.array([]))
        assert batch.observe().shape == (1, observation_size(config))
        return batch.observe()[0]

    both, near, far = seen((1, 4)), seen((1,)), seen((4,))
    body = len(near) - 47
    np.testing.assert_array_equal(both[: body + 45], near[: body + 45])
    np.testing.assert_array_equal(both[body + 45 : body + 90], far[body : body + 45])
    np.testing.assert_array_equal(both[body + 90 :], np.concatenate([near[-2:], far[-2:]]))


def test_start_and_end_of_a_non_cyclic_motion_differ(motion: Motion, puppets) -> None:
    once = ImitationBatch(puppets(3), Reference(replace(motion, cyclic=False)), EnvConfig())
    once.reset(np.arange(3), np.array([0.0, 0.5, 1.0]))
    np.testing.assert_allclose(once.observe()[:, :2], [[0, 1], [1, 0], [0, -1]], atol=1e-12)


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


def test_observations_do_not_depend_on_the_batch_size(motion: Motion, puppets) -> None:
    """Observation and reward of five environments equal those of each alone to the bit."""
    reference, phases = Reference(motion), np.linspace(0.0, 0.9, 5)
    actions = np.random.default_rng(2).normal(0, 0.3, (5, ACTIONS))
    states = scattered(reference, phases)

    def play(rows: slice) -> tuple[np.ndarray, ...]:
        world = puppets(len(phases[rows]))
        batch = ImitationBatch(world, reference, EnvConfig())
        batch.reset(np.arange(world.size), phases[rows])
        world.put(BodyStates(*(getattr(states, f.name)[rows] for f in fields(BodyStates))))
        step = batch.step(actions[rows])
        return step.observations, batch.terms(), world.targets

    together = play(slice(None))
    for k in range(5):
        for whole, alone in zip(together, play(slice(k, k + 1)), strict=True):
            np.testing.assert_array_equal(whole[k], alone[0])


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
