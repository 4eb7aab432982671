"""Training that goes on beyond its budget as long as no evaluation walks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from peers.small_training import ROUND, SMALL

from kinemimic.pipeline.cli.progress import reported_to
from kinemimic.pipeline.cli.progress_state import ProgressState
from kinemimic.pipeline.files.store import write_text
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.command import train
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.evaluation import Evaluation
from kinemimic.train.rollout.policy import training_summary

# Both within a round.
PATIENT = replace(SMALL, budget=ROUND - 10, max_budget=4 * ROUND - 10)


@pytest.fixture
def run(tmp_path: Path, motion: Motion) -> Path:
    write_text(tmp_path / "run" / "motion.json", motion_to_json(motion))
    return tmp_path / "run"


def test_a_policy_that_falls_is_trained_to_the_largest_budget(run: Path) -> None:
    record = train(run, config=PATIENT, workers=1)
    assert record["samples"] == 4 * ROUND
    assert [one["samples"] for one in record["evaluations"]] == [ROUND, 4 * ROUND]
    assert training_summary(record)["budget"] == PATIENT.max_budget
    assert TrainConfig.from_json(record["config"]) == PATIENT


def test_one_that_walks_ends_at_the_budget(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Evaluation, "walks", property(lambda _: True))
    record = train(run, config=PATIENT, workers=1)
    assert record["samples"] == ROUND
    assert training_summary(record)["budget"] == PATIENT.budget


def test_the_first_evaluation_that_walks_ends_it(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Evaluation, "walks", property(lambda one: one.samples >= 3 * ROUND))
    monkeypatch.setattr("kinemimic.train.ppo.runner.PpoRunner.evaluation_interval", ROUND)
    assert train(run, config=PATIENT, workers=1)["samples"] == 3 * ROUND


def test_progress_is_of_the_budget_until_training_goes_on(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kinemimic.train.ppo.runner.PpoRunner.evaluation_interval", ROUND)

    def totals(budget: int | None) -> list[float]:
        seen: list[float] = []

        def note(state: ProgressState) -> None:
            if state.what == "train":
                seen.append(state.total)

        with reported_to(note):
            train(run, config=PATIENT, budget=budget, workers=1)
        return seen

    assert set(totals(2 * ROUND)) == {2 * ROUND}
    # Beyond the budget from the start.
    assert totals(None)[-1] == PATIENT.max_budget
    (run / "checkpoint.safetensors").unlink()
    monkeypatch.setattr(Evaluation, "walks", property(lambda _: True))
    assert set(totals(None)) == {PATIENT.budget}


def test_a_budget_of_ones_own_is_the_end(run: Path) -> None:
    assert train(run, config=PATIENT, budget=2 * ROUND, workers=1)["samples"] == 2 * ROUND
    # The same training goes on, and its checkpoint is not set aside.
    assert train(run, config=PATIENT, workers=1)["samples"] == 4 * ROUND
    assert not (run / "checkpoint.previous.safetensors").exists()


def test_without_a_largest_budget_the_record_stays_as_it_was() -> None:
    assert "max_budget" not in SMALL.to_json()
    assert TrainConfig.from_json(SMALL.to_json()) == SMALL
