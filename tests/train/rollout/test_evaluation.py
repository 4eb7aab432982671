"""Trials: what a performance comes to, which policy is the best, and when a figure first walks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from peers.constant import constant

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig, RewardConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout import evaluation as trial
from kinemimic.train.rollout.evaluation import (
    Episode,
    Evaluation,
    Evaluator,
    best,
    episode_frames,
    first_walk,
    is_due,
)
from kinemimic.train.scenario.scenario import Range, Scenario
from kinemimic.train.sim.world import CONTROL_RATE

STILL = constant()
EVALUATION = Evaluation(
    samples=10,
    seconds=1.0,
    strength=0.0,
    frames=600,
    frames_first=600,
    of=600,
    reward=0.5,
    knee=0.95,
    hip=0.95,
)


def test_of_episodes_of_several_lengths_the_one_that_ends_first_for_its_length_counts() -> None:
    def of(*lengths: tuple[int, int]) -> Evaluation:
        episodes = [Episode(frames, whole, 0.5, 0.95, 0.95) for frames, whole in lengths]
        return Evaluation.of_episodes(episodes, samples=1, seconds=1.0, strength=0.0)

    whole = of((600, 600), (120, 120))
    assert (whole.frames, whole.of, whole.completed) == (600, 600, 2) and whole.walks
    fallen = of((300, 600), (120, 120), (90, 120))
    assert (fallen.frames, fallen.of, fallen.completed) == (300, 600, 1) and not fallen.walks


def rehearse(
    motion: Motion,
    puppets,
    monkeypatch: pytest.MonkeyPatch,
    *,
    lost_at: int | None,
    reward: RewardConfig = RewardConfig(),  # noqa: B008 (frozen)
) -> Episode:
    """By a figure that is always where its reference is, until it explodes after so many steps."""
    reference = Reference(motion)

    class Perfect(puppets):
        steps = 0

        def step(self, *arguments):
            self.steps += 1
            self.lost[:] = lost_at is not None and self.steps > lost_at
            at = 0.25 + self.steps / (CONTROL_RATE * reference.duration)
            self.put(reference.bodies(np.array([at])))
            return self.states()

    monkeypatch.setattr(trial, "open_world", lambda size, engine: Perfect(size))
    return Evaluator(motion, reference, EnvConfig(), "puppets").run_episode(STILL, reward, 0.25)


def test_a_perfect_performance_is_worth_one(motion: Motion, puppets, monkeypatch: pytest.MonkeyPatch) -> None:
    found = rehearse(motion, puppets, monkeypatch, lost_at=None)
    assert (found.frames, found.of) == (600, 600)
    assert found.reward == pytest.approx(1.0, abs=1e-6)
    assert found.knee == pytest.approx(1.0, abs=1e-6)
    assert found.hip == pytest.approx(1.0, abs=1e-6)


def test_nothing_counts_after_the_fall(motion: Motion, puppets, monkeypatch: pytest.MonkeyPatch) -> None:
    # 150 frames of 600 are 5 s, a little over four cycles of 1.2 s: a quarter of the variance, about.
    found = rehearse(motion, puppets, monkeypatch, lost_at=150)
    assert found.frames == 150
    assert found.reward == pytest.approx(0.25, abs=1e-6)
    assert found.knee == pytest.approx(0.25, abs=0.02)
    assert found.hip == pytest.approx(0.25, abs=0.02)
    assert rehearse(motion, puppets, monkeypatch, lost_at=0) == Episode(0, 600, 0.0, 0.0, 0.0)


def test_the_reward_is_a_share_of_the_largest(
    motion: Motion, puppets, monkeypatch: pytest.MonkeyPatch
) -> None:
    double = RewardConfig(weights={name: 2.0 * weight for name, weight in RewardConfig().weights.items()})
    found = rehearse(motion, puppets, monkeypatch, lost_at=300, reward=double)
    assert found.reward == pytest.approx(0.5, abs=1e-6)


def test_two_attempts_are_the_same_and_a_real_figure_falls_without_a_policy(
    engine: str, motion: Motion
) -> None:
    rehearsal = Evaluator(motion, Reference(motion), EnvConfig(), engine)
    first = rehearsal.run_episode(STILL, EnvConfig().reward, 0.0)
    rehearsal.run_episode(STILL, EnvConfig().reward, 0.5)
    assert rehearsal.run_episode(STILL, EnvConfig().reward, 0.0) == first
    assert 0 < first.frames < 100


def test_a_scenario_is_tried_from_several_phases_and_from_a_single_one_once(motion: Motion) -> None:
    assert trial.selection_phases(motion, Scenario("any")) == tuple((k + 0.5) / 8 for k in range(8))
    assert trial.selection_phases(motion, Scenario("one", phase=Range.of(0.25))) == (0.25,)
    assert trial.selection_phases(replace(motion, cyclic=False), Scenario("any")) == (0.0,)


def test_the_policy_is_chosen_on_other_phases_than_those_reported(motion: Motion) -> None:
    reported = np.array(trial.reported_phases(motion))
    assert reported == pytest.approx(np.arange(13) / 13)
    assert trial.reported_phases(replace(motion, cyclic=False)) == (0.0,)
    assert trial.selection_phases(motion) == (pytest.approx(1 / 26), 0.5)
    six = [(k + 0.5) / 13 for k in (0, 2, 4, 6, 8, 10)]
    assert trial.selection_phases(motion, episodes=6) == pytest.approx(six)
    for scenario, apart in ((None, 1 / 26), (Scenario("any"), 1 / 208)):
        chosen = np.array(trial.selection_phases(motion, scenario))
        gaps = np.abs(chosen[:, None] - reported)
        assert np.minimum(gaps, 1 - gaps).min() == pytest.approx(apart)


def test_a_trial_is_as_good_as_its_worse_attempt() -> None:
    run_episodes = [Episode(600, 600, 0.9, 0.99, 0.95), Episode(300, 600, 0.4, 0.5, 0.55)]
    found = Evaluation.of_episodes(run_episodes, samples=7, seconds=1.26, strength=0.5)
    assert found == Evaluation(7, 1.3, 0.5, 300, 600, 600, 0.65, 0.5, 0.55, completed=1, episodes=2)
    assert not found.walks
    hard = Evaluation.of_episodes(run_episodes, [0.1, 0.6, 0.8], samples=7, seconds=1.26, strength=0.5)
    assert hard == replace(found, robust_return=pytest.approx(0.5))
    told = Evaluation.of_episodes(run_episodes, samples=7, seconds=1.26, strength=0.5, losses=[0.2, 0.4])
    assert told == replace(found, critic_loss=pytest.approx(0.3))


def test_the_first_walk_is_the_first_that_neither_falls_nor_strays() -> None:
    fell, strayed = replace(EVALUATION, frames=599), replace(EVALUATION, hip=0.89)
    assert first_walk([fell, strayed]) is None
    assert first_walk([fell, strayed, replace(EVALUATION, samples=30, seconds=3.5), EVALUATION]) == {
        "samples": 30,
        "seconds": 3.5,
    }


def test_the_best_is_the_first_of_equals() -> None:
    trials = [replace(EVALUATION, samples=k, reward=reward) for k, reward in enumerate((0.1, 0.7, 0.7, 0.3))]
    assert best(trials) is trials[1]


def test_whoever_learnt_under_more_hardship_is_kept_before_whoever_did_better_without() -> None:
    learnt = ((0.0, 0.9), (0.4, 0.8), (1.0, 0.6), (1.0, 0.7))
    trials = [replace(EVALUATION, strength=strength, reward=reward) for strength, reward in learnt]
    assert [best(trials[:n]) is trials[n - 1] for n in (1, 2, 3, 4)] == [True] * 4


def test_under_hardships_whoever_endures_most_is_kept() -> None:
    did = ((0.9, 0.3), (0.7, 0.5), (0.8, 0.4))
    trials = [
        replace(EVALUATION, strength=1.0, reward=reward, robust_return=robust_return)
        for reward, robust_return in did
    ]
    assert best(trials) is trials[1]


def test_trials_fall_due_by_samples() -> None:
    every = trial.EVALUATION_INTERVAL
    due = [is_due(k * 4096, (k + 1) * 4096, every) for k in range(2 * every // 4096)]
    assert np.flatnonzero(due).tolist() == [every // 4096 - 1, 2 * every // 4096 - 1]
    # A round that is longer than the distance gives one trial.
    assert is_due(0, 3 * every, every)


def test_what_is_performed_once_is_tried_once_to_its_last_frame(motion: Motion) -> None:
    once = replace(motion, cyclic=False, rate=30.0)
    assert episode_frames(once) == len(motion.root) - 1
    assert trial.selection_phases(once) == (0.0,)
    assert episode_frames(motion) == 600
    assert len(trial.selection_phases(motion)) == 2
