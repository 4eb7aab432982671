"""Tasks of a comparison: a run folder, in a scenario or in none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from kinemimic.evaluate.compare.task import ComparisonTask
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.scenario.scenario_file import find_scenario


def test_a_task_is_a_run_in_a_scenario_or_in_none(tmp_path: Path) -> None:
    assert ComparisonTask.parsed("runs/walk") == ComparisonTask(Path("runs/walk"))
    within = ComparisonTask.parsed("runs/walk@slippery")
    assert within == ComparisonTask(Path("runs/walk"), find_scenario("slippery"))
    assert within.name == "walk@slippery"
    (tmp_path / "me@home").mkdir()
    assert ComparisonTask.parsed(str(tmp_path / "me@home")).name == "me@home"
    with pytest.raises(KinemimicError, match="no-such"):
        ComparisonTask.parsed("runs/walk@no-such")


def test_a_task_changes_of_a_configuration_its_scenario_only() -> None:
    named = find_scenario("slippery")
    config = ComparisonTask(Path("walk"), named).configured(PRESETS["ddpg"])
    assert config.env.scenario == named
    assert replace(config, env=replace(config.env, scenario=None)) == PRESETS["ddpg"]
