"""Observations: their parts, their heading, their previews."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
from peers.elsewhere import turned

from kinemimic.pipeline.kinematics.rotations import (
    conjugate,
    from_axis_angle,
    multiply,
    normalize,
    rotate,
    to_6d,
    to_rotvec,
)
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.pybullet_world import BulletWorld
from kinemimic.train.sim.world import BodyStates
from kinemimic.train.task.env import ACTIONS, ImitationBatch
from kinemimic.train.task.observation import OBSERVATIONS, observation_size


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
