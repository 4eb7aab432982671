"""A training with corrections: one before the first round, one after the last, and none that is worse."""

from __future__ import annotations

import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from kinemimic.pipeline.files.store import write_text
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train import command as stage
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.learning_control import LearningControl
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.learning_control.corrector import correction_samples
from kinemimic.train.rollout.evaluation import Evaluation, best, is_better
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.scenario.scenario_file import scenario

SETTINGS = LearningControl(iterations=1, environments=1, cycles=1, goal=2.0)  # out of reach
SMALL = replace(
    PRESETS["default"],
    num_envs=4,
    horizon=16,
    minibatch=32,
    epochs=2,
    hidden=(32, 16),
    learning_control=SETTINGS,
)
ROUND = SMALL.batch


class Moves:
    """In place of a Corrector: its policies differ from what they are made of by the first bias."""

    calls: ClassVar[list[float]] = []
    interrupts: ClassVar[set[int]] = set()

    def __init__(self, motion: Motion, config: TrainConfig, *_: Any) -> None:
        assert config.learning_control is not None
        self.samples = correction_samples(motion, config.learning_control)

    def correct(self, policy: Policy, proceed: Callable[[int], bool]) -> Policy | None:
        self.calls.append(float(policy.layers[0][1][0]))
        if len(self.calls) in self.interrupts:
            signal.raise_signal(signal.SIGINT)
        if not proceed(self.samples):
            return None
        (weight, bias), *rest = policy.layers
        return replace(policy, layers=((weight, bias + np.float32(1.0)), *rest))

    def close(self) -> None:
        pass


@pytest.fixture
def run(tmp_path: Path, motion: Motion, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(stage, "Corrector", Moves)
    Moves.calls.clear()
    Moves.interrupts.clear()
    write_text(tmp_path / "run" / "motion.json", motion_to_json(motion))
    return tmp_path / "run"


@pytest.fixture
def keep(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every corrected policy is better, although it falls."""
    monkeypatch.setattr("kinemimic.train.runner.training_loop.is_better", lambda *_: True)


def config(motion: Motion, rounds: int = 2, **options: Any) -> TrainConfig:
    """With this many rounds between two corrections."""
    assert SMALL.learning_control is not None
    cost = correction_samples(motion, SMALL.learning_control)
    return replace(SMALL, budget=2 * cost + rounds * ROUND, **options)


def first_bias(run: Path) -> float:
    return float(Policy.load(run / "policy.safetensors")[0].layers[0][1][0])


@pytest.mark.usefixtures("keep")
def test_it_begins_and_ends_with_a_correction_within_the_budget(run: Path, motion: Motion) -> None:
    settings = config(motion)
    record = stage.train(run, config=settings, workers=1)
    assert record["samples"] == settings.budget
    assert [one["corrected"] for one in record["evaluations"]] == [True, False, True]
    assert record["best"] == record["evaluations"][-1]
    # The first corrected policy is kept, but the rounds do not go on from it.
    start, trained = Moves.calls
    assert start == 0.0
    assert abs(trained) < 0.5
    assert first_bias(run) == pytest.approx(trained + 1.0)
    assert record["seconds_by"]["learning control"] >= 0.0
    # The same command has nothing left to do.
    assert stage.train(run, config=settings, workers=1)["samples"] == settings.budget
    assert len(Moves.calls) == 2


@pytest.mark.usefixtures("keep")
def test_it_ends_where_a_corrected_policy_reaches_the_goal(run: Path, motion: Motion) -> None:
    settings = replace(config(motion), learning_control=replace(SETTINGS, goal=-1e9))
    for _ in range(2):
        record = stage.train(run, config=settings, workers=1)
        assert [one["corrected"] for one in record["evaluations"]] == [True]
        assert record["samples"] == record["best"]["samples"]
        assert record["finished"]
    assert len(Moves.calls) == 1
    assert first_bias(run) == 1.0


@pytest.mark.usefixtures("keep")
def test_it_is_also_corrected_between_the_rounds(run: Path, motion: Motion) -> None:
    settings = config(motion, rounds=4)
    assert settings.learning_control is not None
    cost = correction_samples(motion, settings.learning_control)
    # The first correction, two rounds, the second one, and one more round: the last one takes its samples.
    meanwhile = replace(settings.learning_control, meanwhile=2 * cost + 2 * ROUND)
    settings = replace(settings, budget=3 * cost + 3 * ROUND, learning_control=meanwhile)
    record = stage.train(run, config=settings, workers=1)
    found = [(one["samples"], one["corrected"]) for one in record["evaluations"]]
    assert found == [
        (cost, True),
        (cost + 2 * ROUND, False),
        (2 * cost + 2 * ROUND, True),
        (2 * cost + 3 * ROUND, False),
        (3 * cost + 3 * ROUND, True),
    ]
    assert record["samples"] == settings.budget
    # Each corrects the policy of the rounds, not a corrected one.
    assert len(Moves.calls) == 3
    assert all(abs(bias) < 0.5 for bias in Moves.calls)


def test_a_corrected_policy_that_falls_is_not_kept(run: Path, motion: Motion) -> None:
    record = stage.train(run, config=config(motion), workers=1)
    assert [one["corrected"] for one in record["evaluations"]] == [False]
    assert len(Moves.calls) == 2
    assert first_bias(run) == pytest.approx(Moves.calls[1])


@pytest.mark.usefixtures("keep")
@pytest.mark.parametrize("interrupted", [1, 2])
def test_an_interrupted_correction_is_begun_again(run: Path, motion: Motion, interrupted: int) -> None:
    Moves.interrupts.add(interrupted)
    # A job that a shell put into the background has a SIGINT that is ignored.
    earlier = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            stage.train(run, config=config(motion), workers=1)
    finally:
        signal.signal(signal.SIGINT, earlier)
    Moves.interrupts.clear()
    resumed = stage.train(run, config=config(motion), workers=1)
    weights = Policy.load(run / "policy.safetensors")[0].layers[0][0]
    (run / "checkpoint.safetensors").unlink()
    whole = stage.train(run, config=config(motion), workers=1)
    assert resumed["samples"] == whole["samples"]
    np.testing.assert_array_equal(weights, Policy.load(run / "policy.safetensors")[0].layers[0][0])


def test_there_is_none_where_it_does_not_apply(motion: Motion) -> None:
    settings = config(motion)
    assert stage._with_learning_control(settings, motion)[1] > 0
    once = replace(motion, cyclic=False)
    in_scenario = replace(settings, env=replace(settings.env, scenario=scenario("slopes")))
    for other, imitated in (
        (replace(settings, budget=settings.budget - 2 * ROUND), motion),
        (settings, once),
        (in_scenario, motion),
        (replace(settings, learning_control=None), motion),
    ):
        found, samples = stage._with_learning_control(other, imitated)
        assert (found.learning_control, samples) == (None, 0)


def test_a_configuration_with_one_is_read_back(motion: Motion) -> None:
    settings = config(motion)
    assert TrainConfig.from_json(settings.to_json()) == settings
    assert "learning_control" not in PRESETS["default"].to_json()


def evaluation(
    knee: float, hip: float, *, reward: float = 0.5, frames: int = 600, corrected: bool = False
) -> Any:
    return Evaluation(
        samples=1, seconds=1.0, strength=0.0, frames=frames, frames_first=frames, of=600, reward=reward,
        knee=knee, hip=hip, corrected=corrected,
    )  # fmt: skip


def test_a_corrected_policy_must_walk_and_fit_better_than_the_best() -> None:
    walks, falls = evaluation(0.96, 0.95), evaluation(0.5, 0.4, frames=100)
    assert is_better(evaluation(0.97, 0.95, corrected=True), [walks])
    assert is_better(evaluation(0.92, 0.91, corrected=True), [falls])
    assert is_better(evaluation(0.92, 0.91, corrected=True), [])
    assert not is_better(evaluation(0.97, 0.93, corrected=True), [walks])
    assert not is_better(evaluation(0.99, 0.99, frames=599, corrected=True), [falls])
    assert not is_better(evaluation(0.97, 0.89, corrected=True), [])


def test_the_last_corrected_policy_is_the_best() -> None:
    first, last = evaluation(0.96, 0.96, corrected=True), evaluation(0.97, 0.97, corrected=True)
    assert best([evaluation(0.9, 0.9, reward=0.9), first, evaluation(0.95, 0.95, reward=0.8), last]) is last
    assert best([evaluation(0.9, 0.9, reward=0.9), evaluation(0.95, 0.95, reward=0.8)]).reward == 0.9
