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
from kinemimic.train.learning_control.corrector import Correctable, correction_samples
from kinemimic.train.rollout.evaluation import Evaluation, best, fit
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.runner import training_loop
from kinemimic.train.scenario.scenario_file import find_scenario
from kinemimic.train.settings import settings_for

# The goal is out of reach.
SETTINGS = LearningControl(iterations=1, environments=1, cycles=1, rounds=0, goal=2.0)
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

    def __init__(self, algorithm: Correctable, motion: Motion, *_: Any) -> None:
        self.algorithm = algorithm
        assert algorithm.config.learning_control is not None
        self.samples = correction_samples(motion, algorithm.config.learning_control)

    def correct(self, proceed: Callable[[int], bool]) -> Policy | None:
        policy = self.algorithm.policy()
        self.calls.append(float(policy.layers[0][1][0]))
        if len(self.calls) in self.interrupts:
            signal.raise_signal(signal.SIGINT)
        if not proceed(self.samples):
            return None
        (weight, bias), *rest = policy.layers
        return replace(policy, layers=((weight, bias + np.float32(1.0)), *rest))

    def adopt(self, policy: Policy) -> None:
        self.algorithm.begin_from(policy)

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
def upright(monkeypatch: pytest.MonkeyPatch) -> None:
    """No policy falls."""
    monkeypatch.setattr(Evaluation, "falls", False)


@pytest.fixture
def keep(upright: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every corrected policy is better."""
    monkeypatch.setattr(training_loop, "fit", lambda evaluation: evaluation.corrected)


def config(motion: Motion, rounds: int = 2, **options: Any) -> TrainConfig:
    """With this many rounds between two corrections."""
    assert SMALL.learning_control is not None
    cost = correction_samples(motion, SMALL.learning_control)
    return replace(SMALL, budget=2 * cost + rounds * ROUND, **options)


def first_bias(run: Path) -> float:
    return float(Policy.load(run / "policy.safetensors")[0].layers[0][1][0])


def found(record: dict[str, Any]) -> list[tuple[int, bool]]:
    return [(one["samples"], one["corrected"]) for one in record["evaluations"]]


@pytest.mark.usefixtures("keep")
def test_it_begins_and_ends_with_a_correction_within_the_budget(run: Path, motion: Motion) -> None:
    settings = config(motion)
    assert settings.learning_control is not None
    cost = correction_samples(motion, settings.learning_control)
    record = stage.train(run, config=settings, workers=1)
    assert record["samples"] == settings.budget
    rounds = cost + 2 * ROUND
    assert found(record) == [(0, False), (cost, True), (rounds, False), (rounds + cost, True)]
    # The rounds go on from the corrected policy.
    start, trained = Moves.calls
    assert start == 0.0
    assert trained == pytest.approx(1.0, abs=0.5)
    assert "learning control" in record["seconds_by"]
    # The same command has nothing left to do.
    assert stage.train(run, config=settings, workers=1)["samples"] == settings.budget
    assert len(Moves.calls) == 2


@pytest.mark.usefixtures("keep")
def test_it_ends_where_a_policy_reaches_the_goal(
    run: Path, motion: Motion, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Evaluation, "walks", property(lambda evaluation: evaluation.corrected))
    settings = replace(config(motion), learning_control=replace(SETTINGS, goal=-1e9))
    for _ in range(2):
        record = stage.train(run, config=settings, workers=1)
        assert [one["corrected"] for one in record["evaluations"]] == [False, True]
        assert record["finished"]
        assert record["samples"] == record["evaluations"][-1]["samples"]
    assert len(Moves.calls) == 1


@pytest.mark.usefixtures("keep")
def test_it_is_also_corrected_between_the_rounds(run: Path, motion: Motion) -> None:
    settings = config(motion, rounds=3)
    assert settings.learning_control is not None
    cost = correction_samples(motion, settings.learning_control)
    often = replace(settings.learning_control, interval=2 * ROUND)
    settings = replace(settings, budget=settings.budget + cost, learning_control=often)
    record = stage.train(run, config=settings, workers=1)
    assert found(record) == [
        (0, False),
        (cost, True),
        (cost + 2 * ROUND, False),
        (2 * cost + 2 * ROUND, True),
        (2 * cost + 3 * ROUND, False),
        (3 * cost + 3 * ROUND, True),
    ]
    assert record["samples"] == settings.budget
    assert Moves.calls == pytest.approx([0.0, 1.0, 2.0], abs=0.5)


@pytest.mark.usefixtures("upright")
def test_a_corrected_policy_that_is_worse_is_not_adopted(
    run: Path, motion: Motion, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(training_loop, "fit", lambda evaluation: -evaluation.corrected)
    record = stage.train(run, config=config(motion), workers=1)
    assert [one["corrected"] for one in record["evaluations"]] == [False, False]
    assert Moves.calls == pytest.approx([0.0, 0.0], abs=0.5)
    assert abs(first_bias(run)) < 0.5


def test_a_policy_that_falls_is_not_corrected(run: Path, motion: Motion) -> None:
    settings = config(motion)
    assert settings.learning_control is not None
    often = replace(settings, learning_control=replace(settings.learning_control, interval=ROUND))
    record = stage.train(run, config=often, workers=1)
    assert not Moves.calls
    assert [one["corrected"] for one in record["evaluations"]] == [False] * len(record["evaluations"])
    assert record["evaluations"][-1]["samples"] == record["samples"]


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
    assert settings_for(motion, config=settings).reserved > 0
    once = replace(motion, cyclic=False)
    in_scenario = replace(settings, env=replace(settings.env, scenario=find_scenario("slopes")))
    for other, imitated in (
        (replace(settings, budget=settings.budget - 2 * ROUND), motion),
        (settings, once),
        (in_scenario, motion),
        (replace(settings, learning_control=None), motion),
    ):
        found = settings_for(imitated, config=other)
        assert (found.config.learning_control, found.reserved) == (None, 0)


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


def test_with_learning_control_the_best_falls_least_and_then_fits_best() -> None:
    falls, corrected = evaluation(0.99, 0.99, frames=599), evaluation(0.96, 0.96, corrected=True)
    later, rewarded = evaluation(0.95, 0.98, reward=0.8), evaluation(0.9, 0.9, reward=0.9)
    assert fit(falls) < fit(corrected) < fit(later)
    assert best([falls, corrected, later, rewarded], by_fit=True) is later
    assert best([falls, corrected, later, rewarded]) is rewarded
