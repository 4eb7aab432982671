"""Training in a scenario: other samples, resumed to the last bit in the midst of what flies."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from peers.small_training import ROUND, SMALL
from safetensors.numpy import load_file

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import write_text
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train import command as stage
from kinemimic.train import settings
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.scenario.scenario import Load, Placement, Range, Scenario

PUSH = Load(
    "torso", Range((0.0,), (0.5,)), Range.of(0.2), force=Range((-80.0, -80.0, 0.0), (80.0, 80.0, 0.0))
)
BOX = Placement("box", Range.of(0.3, 0.3, 0.4), Range((0.6, -0.3), (1.0, 0.3)), mass=Range.of(2.0))
BALL = replace(
    BOX, shape="sphere", position=Range.of(1.0, 0.0, 1.2), at=Range.of(0.2), velocity=Range.of(-3.0, 0.0, 0.0)
)
YARD = Scenario("yard", loads=(PUSH,), obstacles=(BOX, BALL))


@pytest.fixture
def folders(tmp_path: Path, motion: Motion, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    monkeypatch.setitem(PRESETS, "default", SMALL)
    for name in "abc":
        write_text(tmp_path / name / "motion.json", motion_to_json(motion))
    return [tmp_path / name for name in "abc"]


def test_a_training_in_a_scenario_resumes_to_the_last_bit(folders: list[Path]) -> None:
    whole, parts, calm = folders
    stage.train(whole, budget=3 * ROUND, workers=1, scenario=YARD)
    # Each part ends with a trial, which nothing that learns knows of.
    for budget in (ROUND, 2 * ROUND, 3 * ROUND):
        stage.train(parts, budget=budget, workers=1, scenario=YARD)
    stage.train(calm, budget=3 * ROUND, workers=1)
    learnt = [load_file(folder / "checkpoint.safetensors") for folder in (whole, parts, calm)]
    # But for the best of all trials, of which the parts have more.
    for name in (name for name in learnt[0] if not name.startswith("best.")):
        np.testing.assert_array_equal(learnt[0][name], learnt[1][name], err_msg=name)
    assert (learnt[2]["algorithm.actor"] != learnt[0]["algorithm.actor"]).any()
    assert learnt[0]["env_states.obstacles"].any()
    _, record = Policy.load(whole / "policy.safetensors")
    assert TrainConfig.from_json(record["config"]).env.scenario == YARD


def test_a_scenario_that_cannot_be_is_refused_before_anything_begins(folders: list[Path]) -> None:
    wall = Scenario("wall", obstacles=(replace(BOX, position=Range.of(0.0, 0.0)),))
    with pytest.raises(KinemimicError, match=r"scenario wall: expected obstacle 1 \(box\) apart"):
        stage.train(folders[0], budget=ROUND, scenario=wall)
    found = CliRunner().invoke(stage.command, ["--run", str(folders[0]), "--scenario", "nowhere"])
    assert isinstance(found.exception, KinemimicError)
    assert "expected a shipped scenario" in str(found.exception)
    assert [path.name for path in folders[0].iterdir()] == ["motion.json"]


def test_what_a_worker_cannot_draw_is_its_line(folders: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """A draw that none of those before the training had."""
    wall = Scenario("wall", obstacles=(replace(BOX, position=Range.of(0.0, 0.0)),))
    monkeypatch.setattr(settings, "check", lambda *_: None)
    with pytest.raises(KinemimicError, match=r"scenario wall: expected obstacle 1 \(box\) apart"):
        stage.train(folders[0], budget=ROUND, workers=2, scenario=wall)
