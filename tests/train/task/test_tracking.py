"""The task of a tracker: what it observes, and when an episode ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from peers.elsewhere import turned

from kinemimic.pipeline.kinematics.rotations import from_rotvec, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.env_config import OBSERVATION_CLIP, EnvConfig, Tracking
from kinemimic.train.reference.reference import Reference
from kinemimic.train.reference.reference_library import FollowedReference, ReferenceLibrary
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import BodyStates
from kinemimic.train.task.env import ACTIONS, ImitationBatch
from kinemimic.train.task.mirror import left_foot_behind
from kinemimic.train.task.observation import observation_size
from kinemimic.train.task.observation_layout import layout, observation_limits

CONFIG = EnvConfig(preview=(1, 4), tracking=Tracking(max_body_error=0.3), mirror=False)


def part(observation: np.ndarray, name: str) -> np.ndarray:
    row = next(row for row in layout(CONFIG) if row["name"] == name)
    found: np.ndarray = observation[..., row["start"] : row["start"] + row["size"]]
    return found


def shifted(bodies: BodyStates, way: tuple[float, float, float]) -> BodyStates:
    return replace(bodies, positions=bodies.positions + np.array(way))


def test_on_its_reference_nothing_is_missing(motion: Motion) -> None:
    batch = ImitationBatch(open_world(1, "pybullet"), Reference(motion), CONFIG)
    batch.reset(np.array([0]), np.array([0.3]))
    observation = batch.observe()[0]
    batch.world.close()
    assert len(observation) == observation_size(CONFIG) == sum(row["size"] for row in layout(CONFIG))
    for name in ("turns_0", "way_to_reference", "linear_to_reference", "angular_to_reference"):
        assert np.abs(part(observation, name)).max() < 1e-3
    assert np.abs(part(observation, "turns_4")).max() > 0.05
    assert "phase" not in [row["name"] for row in layout(CONFIG)]


def test_the_way_to_the_reference_is_in_the_humanoids_heading(motion: Motion) -> None:
    """Of a humanoid that is 0.2 m behind its reference, whichever way both face."""
    found = []
    for one, behind in ((motion, (-0.2, 0.0, 0.0)), (turned(motion, 0.5 * np.pi), (0.0, -0.2, 0.0))):
        batch = ImitationBatch(open_world(1, "pybullet"), Reference(one), CONFIG)
        batch.reset(np.array([0]), np.array([0.3]))
        snapshot = batch.snapshot()
        batch.restore({**snapshot, "root": snapshot["root"] + np.array(behind)})
        found.append(batch.observe()[0])
        batch.world.close()
    ways = part(found[0], "way_to_reference").reshape(-1, 3)
    np.testing.assert_allclose(ways[:, :2], np.tile([0.2, 0.0], (15, 1)), atol=0.02)
    np.testing.assert_allclose(found[1], found[0], atol=1e-5)


@pytest.mark.parametrize("way", [(-0.2, 0.0), (-1.2, 0.5)])
def test_a_far_reference_is_observed_at_the_leash(motion: Motion, way: tuple[float, float]) -> None:
    """As if it were 0.3 m away in its direction; a nearer one where it is."""
    config = replace(CONFIG, tracking=Tracking(max_body_error=9.0, leash=0.3))
    length = float(np.hypot(*way))
    observed = []
    for behind in (np.array(way), np.array(way) * min(1.0, 0.3 / length)):
        batch = ImitationBatch(open_world(1, "pybullet"), Reference(motion), config)
        batch.reset(np.array([0]), np.array([0.3]))
        snapshot = batch.snapshot()
        batch.restore({**snapshot, "root": snapshot["root"] + np.append(behind, 0.0)})
        observed.append(batch.observe()[0])
        batch.world.close()
    np.testing.assert_allclose(observed[0], observed[1], atol=2e-3)
    pelvis = part(observed[0], "way_to_reference")[:2]
    assert np.hypot(*pelvis) == pytest.approx(min(length, 0.3), abs=0.01)


def test_the_arms_limit_is_on_what_an_arm_changes_and_on_nothing_else(motion: Motion) -> None:
    """Of two references that differ in their arms alone, and of the one's humanoid beside the other."""
    config = replace(CONFIG, tracking=Tracking(limit=3.0, arm_limit=1.0))
    rotations = motion.rotations.copy()
    for joint in ("shoulder", "elbow", "wrist"):
        for side in ("left", "right"):
            node = NODE_INDEX[f"{joint}_{side}"]
            rotations[:, node] = multiply(rotations[:, node], from_rotvec(np.array([0.1, -0.3, 0.1])))
    references = [Reference(one) for one in (motion, replace(motion, rotations=rotations))]
    batches = [ImitationBatch(open_world(1, "pybullet"), reference, config) for reference in references]
    for batch in batches:
        batch.reset(np.array([0]), np.array([0.3]))
    observed = [batch.observe()[0] for batch in batches]
    # The humanoid of the one with the reference of the other.
    batches[0].restore(batches[1].snapshot())
    observed.append(batches[0].observe()[0])
    for batch in batches:
        batch.world.close()
    changed = np.ptp(observed, axis=0) > 1e-3
    limits = observation_limits(config)
    # Six bodies: their axes, and eight vectors.
    assert (limits == 1.0).sum() == 6 * (6 + 9 * 3)
    assert (limits == 3.0).sum() == len(limits) - (limits == 1.0).sum()
    assert (limits[changed] == 1.0).all()
    assert changed.sum() > 0.7 * (limits == 1.0).sum()


def test_only_a_tracker_with_limits_has_them() -> None:
    """A record from before there were limits is that of a tracker without them, and stays as it is."""
    assert (observation_limits(EnvConfig()) == OBSERVATION_CLIP).all()
    older = TrainConfig(env=CONFIG).to_json()
    assert "limit" not in older["env"]["tracking"]
    assert (observation_limits(TrainConfig.from_json(older).env) == OBSERVATION_CLIP).all()
    limited = TrainConfig(env=replace(CONFIG, tracking=Tracking(limit=3.0, arm_limit=1.0)))
    assert TrainConfig.from_json(limited.to_json()) == limited


def test_the_observation_does_not_depend_on_the_lap(motion: Motion) -> None:
    library = ReferenceLibrary([motion])
    followed = FollowedReference(library, np.zeros(2, dtype=np.intp))
    batch = ImitationBatch(open_world(2, "pybullet"), followed, CONFIG)
    batch.reset(np.arange(2), np.array([0.3, 4.3]))
    first, second = batch.observe()
    np.testing.assert_allclose(second, first, atol=1e-6)
    batch.world.close()


@pytest.mark.parametrize(("distance", "ends"), [(0.29, False), (0.31, True)])
def test_an_episode_ends_at_the_mean_distance_of_the_bodies(
    puppets, motion: Motion, distance: float, ends: bool
) -> None:
    world, reference = puppets(1), Reference(motion)
    batch = ImitationBatch(world, reference, CONFIG)
    batch.reset(np.array([0]), np.array([0.3]))
    after = reference.bodies(np.array([0.3 + 1.0 / (30 * motion.duration)]))
    world.put(shifted(after, (-1.0, distance, 0.0)))  # a step moves a puppet by a metre
    assert batch.step(np.zeros((1, ACTIONS))).terminated.tolist() == [ends]


def test_the_left_foot_is_behind_in_one_half_of_a_cycle(motion: Motion) -> None:
    bodies = Reference(motion).bodies(np.arange(100) / 100)
    behind = left_foot_behind(bodies)
    np.testing.assert_array_equal(behind, ~np.roll(behind, 50))
    assert behind.sum() == 50


def test_the_configuration_survives_json() -> None:
    config = TrainConfig(env=CONFIG)
    assert TrainConfig.from_json(config.to_json()) == config
    assert "tracking" not in TrainConfig().to_json()["env"]
