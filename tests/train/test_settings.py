"""Settings of a training: a preset or a tracker, and what the user changes of it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from peers.teachers import write_teacher

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.library.exercises import exercise
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.rollout.tracker_file import load_tracker, tracker_path
from kinemimic.train.scenario.scenario_file import find_scenario
from kinemimic.train.settings import LEAST, settings_for
from kinemimic.train.task.observation import observation_size


def test_a_preset_starts_from_random_weights(motion: Motion) -> None:
    found = settings_for(motion, preset_name="paper", seed=3)
    assert found.config == replace(PRESETS["paper"], seed=3)
    assert found.initial is None


def test_a_tracker_brings_its_weights_and_is_named_by_its_hash(motion: Motion) -> None:
    found = settings_for(motion, start="tracker")
    assert found.initial is not None
    assert found.initial.layers[0][0].shape[0] == found.config.hidden[0]
    assert found.config.start == file_hash(tracker_path("tracker"))
    assert found.config.max_budget > found.config.budget


def test_a_policy_acts_as_before_until_it_has_learned_from_obstacles(motion: Motion, tmp_path: Path) -> None:
    teachers = write_teacher(tmp_path / "policy.safetensors", motion).parent
    before = settings_for(motion, start="robust_walk", preset_name="robust").initial
    found = settings_for(motion, start="robust_walk", preset_name="obstacles", teachers=teachers)
    assert before is not None
    assert found.initial is not None
    size = observation_size(found.config.env)
    assert found.initial.shape[0] == size > before.shape[0]
    seen = np.random.default_rng(0).normal(0.0, 1.0, (5, size))
    np.testing.assert_allclose(found.initial.act(seen), before.act(seen[:, : before.shape[0]]), atol=1e-6)
    assert found.initial.critic[0][0].shape == (found.config.hidden[0], size)
    # What a tracker clips lower, it still does.
    for name in ("tracker", "robust_walk"):
        wide = settings_for(motion, start=name, preset_name="obstacles", teachers=teachers).initial
        narrow, _ = load_tracker(tracker_path(name))
        assert wide is not None
        np.testing.assert_array_equal(np.asarray(wide.limit)[: len(narrow.mean)], narrow.limit)
    seeing = replace(found.config, env=replace(found.config.env, observed_obstacles=2))
    with pytest.raises(KinemimicError, match="a policy that observes no obstacles or 2, found one that"):
        found.initial.widened(seeing)


def test_joining_needs_teachers_a_loop_and_nothing_else(motion: Motion, tmp_path: Path) -> None:
    teachers = write_teacher(tmp_path / "policy.safetensors", motion).parent
    joining = partial(settings_for, start="robust_walk", preset_name="obstacles")
    assert len(joining(motion, teachers=teachers).teachers.policies) == 1
    ending = replace(motion, cyclic=False, cycle_offset=np.zeros(3))
    for reason, settings in (
        ("expected --from robust_walk, or a tracker", partial(settings_for, motion, preset_name="obstacles")),
        ("--preset obstacles: expected --teachers, a folder of", partial(joining, motion)),
        ("expected a walk or run that repeats itself", partial(joining, ending, teachers=teachers)),
        ("fixed length and task, found --budget", partial(joining, motion, teachers=teachers, budget=9)),
        ("found --scenario", partial(joining, motion, teachers=teachers, scenario=find_scenario("slopes"))),
        (
            "expected --preset obstacles, found default",
            partial(settings_for, motion, teachers=teachers),
        ),
    ):
        with pytest.raises(KinemimicError, match=reason):
            settings()


def test_the_tracker_of_motions_on_the_spot_learns_no_gait(motion: Motion) -> None:
    as_recorded = replace(motion, cyclic=False, cycle_offset=np.zeros(3))
    for gait in (motion, as_recorded):
        with pytest.raises(KinemimicError, match=r"--from standing: .* without strides, .*a gait"):
            settings_for(gait, start="standing")
        assert not settings_for(gait, start="tracker").config.env.balance
    assert settings_for(exercise(0, 0), start="standing").config.env.balance
    # The report knows whether there are strides: a jump comes forward without, a treadmill holds a walk.
    assert settings_for(as_recorded, start="standing", report={"kind": "motion"}).config.env.balance
    with pytest.raises(KinemimicError, match="found a gait"):
        settings_for(exercise(0, 0), start="standing", report={"kind": "walk"})


def test_a_budget_of_the_user_is_kept(motion: Motion) -> None:
    found = settings_for(motion, start="tracker", budget=300_000).config
    assert (found.budget, found.largest_budget) == (300_000, 300_000)
    with pytest.raises(KinemimicError, match="at least one sample, found 0"):
        settings_for(motion, budget=0)


def test_a_scenario_replaces_that_of_the_settings(motion: Motion) -> None:
    slopes, slippery = find_scenario("slopes"), find_scenario("slippery")
    on_slopes = settings_for(motion, scenario=slopes).config
    assert on_slopes.env.scenario == slopes
    assert settings_for(motion, config=on_slopes, scenario=slippery).config.env.scenario == slippery


def test_recoveries_are_left_out_where_they_do_not_apply(motion: Motion) -> None:
    robust = settings_for(motion, start="tracker", preset_name="robust").config
    assert robust.recovery is not None
    assert settings_for(motion, start="tracker").config.recovery is None
    for other in (
        settings_for(motion, config=robust, budget=LEAST - 1),
        settings_for(motion, config=robust, scenario=find_scenario("slopes")),
        settings_for(replace(motion, cyclic=False), config=robust),
    ):
        assert other.config == replace(
            robust,
            recovery=None,
            budget=other.config.budget,
            env=replace(robust.env, scenario=other.config.env.scenario),
        )
