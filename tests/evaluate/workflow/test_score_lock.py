"""Scores of shipped policies: within their tolerance they are written as recorded, else an error."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.evaluate.workflow import score_lock as module
from kinemimic.evaluate.workflow.score_lock import command, confirmed, metrics
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.versions.params import Params

ROOT = Path(__file__).resolve().parents[3]
PARAMS = Params.load(ROOT / "datasets/versions/params.toml")
TEXT = 'schema = 1\nversion = 1\npolicies = ["walk"]\n[captures]\n[tolerances]\nknee_r2 = 0.01\n'


def recorded(name: str) -> dict[str, Any]:
    scores: dict[str, Any] = json.loads((POLICIES / name / "scores.json").read_text())
    return scores


def test_within_its_tolerance_a_metric_is_the_one_on_record() -> None:
    known = {"frames": 600.0, "r2": 0.95}
    assert confirmed(known, {"frames": 600.0, "r2": 0.953}, {"r2": 0.003001}, "walk") == known
    with pytest.raises(KinemimicError, match=r"on record, found r2 0\.954 instead"):
        confirmed(known, {"frames": 600.0, "r2": 0.954}, {"r2": 0.003}, "walk")
    # What has no tolerance is the same or wrong.
    with pytest.raises(KinemimicError, match="frames 599 instead of 600 ± 0"):
        confirmed(known, {"frames": 599.0, "r2": 0.95}, {"r2": 0.003}, "walk")
    with pytest.raises(KinemimicError, match="r2 nan instead"):
        confirmed(known, {"frames": 600.0, "r2": float("nan")}, {"r2": 0.003}, "walk")
    # As scores.json has what cannot be measured.
    with pytest.raises(KinemimicError, match="r2 none instead"):
        confirmed(known, {"frames": 600.0, "r2": None}, {"r2": 0.003}, "walk")
    assert confirmed({"r2": None}, {"r2": None}, {}, "jump") == {"r2": None}


@pytest.mark.parametrize("name", PARAMS.policies)
def test_committed_scores_match_the_policies(name: str) -> None:
    found = json.loads((ROOT / "datasets/versions/scores" / f"{name}.json").read_text())
    assert found == {"schema": 1, "policy": name, **metrics(recorded(name))}
    assert PARAMS.tolerances.keys() < metrics(recorded(name)).keys()


def test_the_command_writes_the_scores_on_record_or_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "params.toml").write_text(TEXT)
    found = recorded("walk")
    found["fit"]["knee"]["r2"] -= 0.005
    monkeypatch.setattr(module, "evaluate", lambda *_, **__: found)
    target, arguments = tmp_path / "scores" / "walk.json", ["walk", "--params", str(tmp_path / "params.toml")]
    assert CliRunner().invoke(command, arguments).stdout == f"{target}\n"
    assert json.loads(target.read_text())["knee_r2"] == metrics(recorded("walk"))["knee_r2"]
    target.unlink()
    found["fit"]["knee"]["r2"] -= 0.01
    ended = CliRunner().invoke(command, arguments)
    assert isinstance(ended.exception, KinemimicError)
    assert "knee_r2 0.98" in str(ended.exception)
    assert not target.exists()


def test_an_unknown_metric_is_a_one_line_error(tmp_path: Path) -> None:
    for text, name, told in (
        (TEXT, "run", "expected a policy among walk, found 'run'"),
        (TEXT + "knee_r3 = 1\n", "walk", "expected tolerances of compared metrics, found knee_r3"),
    ):
        (tmp_path / "params.toml").write_text(text)
        ended = CliRunner().invoke(command, [name, "--params", str(tmp_path / "params.toml")])
        assert told in str(ended.exception)


@pytest.mark.slow
def test_a_policy_that_ships_has_its_scores(tmp_path: Path) -> None:
    (tmp_path / "params.toml").write_text((ROOT / "datasets/versions/params.toml").read_text())
    ended = CliRunner().invoke(command, ["walk", "--params", str(tmp_path / "params.toml")])
    assert ended.exit_code == 0, ended.exception
