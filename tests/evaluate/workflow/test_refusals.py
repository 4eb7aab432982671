"""kinemimic run: what cannot be is one line, and nothing is written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner

from kinemimic.evaluate.workflow import run as module
from kinemimic.evaluate.workflow.run import run
from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.errors import KinemimicError

Stages = dict[str, Callable[[], None]]


def test_a_policy_of_one_motion_and_training_options_are_refused(
    stages: Stages, capture: Path, tmp_path: Path
) -> None:
    with pytest.raises(KinemimicError, match=r"walk: expected a tracker, .* found a policy of one motion"):
        run(capture, tmp_path / "run", policy="walk")
    with pytest.raises(KinemimicError, match="expected no option of `train`, found --budget"):
        run(capture, tmp_path / "run", policy="tracker", options={"train": {"budget": "1M"}})
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("arguments", "found"),
    [
        (["--policy", "nosuch"], "expected a tracker (standing, tracker), or a run folder with one"),
        (["--policy", "empty"], "expected a tracker (standing, tracker), or a run folder with one"),
        (["--from", "nosuch"], "expected a tracker (standing, tracker), or a run folder with one"),
        (["--from", "walk"], "walk: expected a tracker"),
        (
            ["--from", "tracker", "--preset", "ddpg"],
            "expected --preset robust or obstacles, or none, found ddpg",
        ),
        (["--from", "tracker", "--from-scratch"], "--from-scratch: expected no --from, found both"),
        (
            ["--preset", "obstacles"],
            "--preset obstacles: expected --from robust_walk, or a tracker, found none",
        ),
        (
            ["--from", "robust_walk", "--preset", "obstacles"],
            "--preset obstacles: expected --teachers, a folder of policies trained among obstacles",
        ),
        (["--teachers", "empty"], "--teachers: expected --preset obstacles, found default"),
    ],
)
def test_a_start_that_cannot_be_is_refused_before_anything_begins(
    stages: Stages,
    capture: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    found: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    result = CliRunner().invoke(module.command, [str(capture), "--run", "run", *arguments])
    assert isinstance(result.exception, KinemimicError)
    assert found in str(result.exception)
    assert not Path("run").exists()


@pytest.mark.parametrize("content", [None, b"", b"a walk", bytes(range(256))])
def test_an_invalid_capture_is_one_line_status_2_and_nothing_written(
    content: bytes | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, folder = tmp_path / "walk.skl", tmp_path / "run"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SystemExit) as ended:
        main(["run", str(path), "--run", str(folder)])
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert len(error.strip().splitlines()) == 1
    assert error.startswith(f"kinemimic: {path}: expected ")
    assert not folder.exists()
