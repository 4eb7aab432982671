"""Which capture a run folder belongs to, and which folder a command takes by default."""

from __future__ import annotations

from pathlib import Path

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.stages import VIRTUAL_CAPTURE
from kinemimic.pipeline.run_folder.capture import (
    capture_files,
    default_run,
    only_run,
    require_same_capture,
    run_flag,
    sources_of,
)
from kinemimic.pipeline.run_folder.stage import stage


def ingested(run: Path, capture: Path) -> None:
    with stage(run, "ingest", sources=capture_files(capture)) as out:
        (out / "clip.parquet").write_bytes(capture.read_bytes() if capture.is_file() else b"")


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    path = tmp_path / "walk.bvh"
    path.write_text("a walk")
    return path


def test_another_capture_needs_overwrite(walk: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    require_same_capture(run, walk)
    ingested(run, walk)
    require_same_capture(run, walk)
    copy = tmp_path / "renamed.bvh"
    copy.write_text("a walk")
    require_same_capture(run, copy)
    copy.write_text("a run")
    with pytest.raises(
        KinemimicError, match=r"results of renamed\.bvh, found those of walk\.bvh; .*--overwrite"
    ):
        require_same_capture(run, copy)
    with pytest.raises(KinemimicError, match="--overwrite"):
        require_same_capture(run, run / VIRTUAL_CAPTURE)


def test_a_virtual_capture_of_the_folder_is_known_by_name(tmp_path: Path) -> None:
    run = tmp_path / "run"
    with stage(run, "virtual") as out:
        (out / "capture").mkdir()
        (out / VIRTUAL_CAPTURE).write_text("a walk")
    ingested(run, run / VIRTUAL_CAPTURE)
    (run / VIRTUAL_CAPTURE).write_text("the walk of a later version")
    require_same_capture(run, run / VIRTUAL_CAPTURE)


def test_results_of_an_unknown_capture_need_overwrite(walk: Path, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "motion.json").write_text("{}")
    with pytest.raises(KinemimicError, match="found those of an unknown capture, or of an earlier version"):
        require_same_capture(tmp_path / "run", walk)


def test_the_folder_is_named_after_the_capture(tmp_path: Path) -> None:
    assert default_run(None) == Path("runs/default")
    assert default_run(Path("a/b/walk.02.bvh")) == Path("runs/walk.02")
    assert default_run(Path("a/b/walk.skl.gz")) == Path("runs/walk")
    (tmp_path / "recording.1").mkdir()
    assert default_run(tmp_path / "recording.1") == Path("runs/recording.1")


def test_the_only_run_folder_is_the_default(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(KinemimicError, match="runs: expected a run folder, found none; run `kinemimic run`"):
        only_run()
    for name in ("walk", "study"):
        (tmp_path / "runs" / name).mkdir(parents=True)
    (tmp_path / "runs" / "walk" / "motion.json").write_text("{}")
    assert only_run() == Path("runs/walk")
    (tmp_path / "runs" / "study" / "run.json").write_text("{}")
    with pytest.raises(KinemimicError, match=r"one of its 2 run folders: runs.study, runs.walk"):
        only_run()


def test_advice_names_the_folder_unless_commands_take_it_by_default(
    walk: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_flag(Path("my run")) == " --run 'my run'"
    ingested(Path("runs/walk"), walk)
    assert run_flag(Path("runs/walk")) == run_flag(tmp_path / "runs" / "walk") == ""
    ingested(Path("runs/other"), walk)
    assert run_flag(Path("runs/walk")) == " --run runs/walk"


def test_the_files_of_another_capture_are_not_looked_for_beside_this_one(walk: Path, tmp_path: Path) -> None:
    recording = tmp_path / "recording"
    (recording / "depth").mkdir(parents=True)
    (recording / "depth/0001.png").write_text("an image")
    run = tmp_path / "run"
    ingested(run, recording)
    assert [*sources_of(run, recording)] == ["depth/0001.png"]
    assert [*sources_of(run, walk)] == ["walk.bvh", "truth.parquet", "provenance.json"]


@pytest.mark.parametrize("name", ["/etc/passwd", "../../secret", "../a/../../secret"])
def test_sources_elsewhere_are_refused(name: str, walk: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    ingested(run, walk)
    text = (run / "run.json").read_text()
    assert '"walk.bvh"' in text
    (run / "run.json").write_text(text.replace('"walk.bvh"', f'"{name}"'))
    with pytest.raises(KinemimicError, match="expected files beside a capture, found"):
        sources_of(run, walk)
