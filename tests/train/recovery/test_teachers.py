"""Teachers from a folder act by the mean of their actions; folders that cannot teach are refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from peers.teachers import config_among_obstacles, write_teacher

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import read_json, write_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.tracker import tracker_config
from kinemimic.train.recovery.teachers import TaughtActions, load_teachers
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.env import ImitationBatch

TRACKER = tracker_config().env


def test_of_each_folder_the_policy_of_the_most_samples_teaches(walk: Motion, tmp_path: Path) -> None:
    for seed in range(2):
        for samples in (900, 1_000, 200):
            path = tmp_path / f"seed{seed}" / f"policy-{samples}.safetensors"
            write_teacher(path, walk, leans=samples + seed, samples=samples)
    for aside in ("policy.previous", "outdated/1/policy", "simulate/a/policy"):
        write_teacher(tmp_path / "seed0" / f"{aside}.safetensors", walk, samples=9_999)
    unknown = tmp_path / "seed0" / "policy-200.json"
    write_json(unknown, {**read_json(unknown), "samples": None})
    found = load_teachers(tmp_path, TRACKER)
    assert [one.layers[-1][1][0] for one in found.policies] == [1_000.0, 1_001.0]
    assert found.env == config_among_obstacles().env
    write_teacher(tmp_path / "seed1" / "policy-1000.safetensors", walk, leans=3.0, samples=1_000)
    assert load_teachers(tmp_path, TRACKER).identity != found.identity


def test_they_act_by_the_mean_on_the_sides_of_the_batch(walk: Motion, tmp_path: Path) -> None:
    for seed, leans in enumerate((0.0, 0.02, 0.07)):
        write_teacher(tmp_path / f"seed{seed}" / "policy.safetensors", walk, leans=leans)
    world = open_world(4, "auto")
    batch = ImitationBatch(world, Reference(walk), TRACKER)
    batch.reset(np.arange(4), np.array([0.1, 0.35, 0.6, 0.85]))
    acted = TaughtActions(batch, load_teachers(tmp_path, TRACKER)).act()
    world.close()
    np.testing.assert_allclose(np.abs(acted), 0.03, atol=1e-7)
    # About 0.03 for the humanoid's own left leg in the first half of a cycle, its mirror image in the second.
    assert np.sign(batch.reflected(acted)[:, 1]).tolist() == [1.0] * 4
    assert np.sign(batch.reflected(acted)[:, 0]).tolist() == [1.0, 1.0, -1.0, -1.0]


def test_folders_that_cannot_teach_are_refused(walk: Motion, tmp_path: Path) -> None:
    for name, config in (
        ("free", config_among_obstacles(scenario=None)),
        ("good/a", config_among_obstacles()),
        ("good/b", config_among_obstacles(max_drift=0.7)),
        ("blind", config_among_obstacles(torque_feedforward=False)),
    ):
        write_teacher(tmp_path / name / "policy.safetensors", walk, config=config)
    (tmp_path / "empty").mkdir()
    seeing = config_among_obstacles(observed_obstacles=2)
    write_teacher(tmp_path / "seeing" / "policy.safetensors", walk, config=seeing)
    for name, reason in (
        ("empty", "expected a folder with policies trained among obstacles, found none"),
        ("nosuch", "expected a folder with policies trained among obstacles, found none"),
        (
            "free",
            "free/policy.safetensors: expected a policy trained in a scenario with obstacles",
        ),
        ("good", "expected policies of one task, found several"),
        ("seeing", "expected policies that do not observe obstacles, found some that do"),
        ("blind", "expected policies whose actions correct the reference, found others"),
    ):
        with pytest.raises(KinemimicError, match=reason):
            load_teachers(tmp_path / name, TRACKER)
    assert len(load_teachers(tmp_path / "good/a", TRACKER).policies) == 1


def test_a_seed_more_is_another_group(walk: Motion, tmp_path: Path) -> None:
    write_teacher(tmp_path / "a" / "policy.safetensors", walk)
    one = load_teachers(tmp_path, TRACKER)
    assert replace(one, policies=one.policies * 2).identity != one.identity
