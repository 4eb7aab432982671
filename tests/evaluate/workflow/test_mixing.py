"""A run folder cannot mix two captures: whatever is exchanged, a command refuses it in one line."""

from __future__ import annotations

import os
import resource
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from peers.constant import constant

from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.run_folder.lock import _lock
from kinemimic.pipeline.run_folder.stage import stage
from kinemimic.pipeline.virtual_kinect.recorder import record_virtual
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.rollout import evaluation


def kinemimic(*arguments: str | Path) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(one) for one in arguments])
    return int(ended.value.code or 0)


def trained(run: Path, action: float = 0.0, seed: int = 0) -> None:
    """As `train` would: a policy whose actions are constant."""
    record = {"samples": 0, "seconds": 0.0, "preset": "default", "seed": seed, "mirrored": True}
    record |= {"config": PRESETS["default"].to_json()}
    record |= {"provenance": {"inputs": {"motion": read_motion_json(run / "motion.json").identity}}}
    with stage(run, "train") as out:
        constant(action).save(out / "policy.safetensors", record)


@pytest.fixture(scope="module")
def captures(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("captures")
    return {name: record_virtual(folder, motion=name).euler for name in ("walk", "run")}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, captures: dict[str, Path]) -> dict[str, Path]:
    """Complete run folders of two motions, with trainings of no samples and short rollouts."""
    made = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evaluation, "CYCLIC_FRAMES", 30)
        patch.setattr(evaluation, "START_PHASES", 1)
        for name in ("walk", "run"):
            run = made[name] = tmp_path_factory.mktemp("runs") / name
            assert kinemimic("ingest", captures[name], "--run", run) == 0
            assert kinemimic("convert", "--run", run) == 0
            assert kinemimic("retarget", "--no-refine", "--run", run) == 0
            trained(run)
            assert kinemimic("evaluate", "--run", run) == 0
            assert kinemimic("view", "--run", run) == 0
            assert kinemimic("gait", "--run", run) == 0
    return made


@pytest.fixture
def run(finished: dict[str, Path], tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished["walk"], tmp_path / "walk"))


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Runs a command that must end with status 2 and one line, which is returned."""

    def check(*arguments: str | Path) -> str:
        capsys.readouterr()
        assert kinemimic(*arguments) == 2
        error = capsys.readouterr().err.strip()
        assert error.startswith("kinemimic: ") and len(error.splitlines()) == 1
        return error

    return check


READERS = ("train", "evaluate", "view", "gait", "pushes", "export")


def test_another_capture_in_a_used_folder(
    run: Path,
    captures: dict[str, Path],
    refused: Callable[..., str],
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    other, before = captures["run"], {path: path.stat().st_mtime_ns for path in run.rglob("*")}
    assert "found those of kinect_walk_euler.bvh; choose another --run, or add --overwrite" in refused(
        "ingest", other, "--run", run
    )
    assert "--overwrite" in refused("run", other, "--run", run)
    assert {path: path.stat().st_mtime_ns for path in run.rglob("*")} == before
    capsys.readouterr()
    assert kinemimic("ingest", other, "--run", run, "--overwrite") == 0
    note = f"{run / 'outdated' / '1'}: set aside what was made from the earlier "
    assert caplog.messages[-1].startswith(note)
    assert "found none; run `kinemimic retarget` first" in refused("train", "--run", run)
    assert kinemimic("convert", "--run", run) == 0
    assert kinemimic("retarget", "--no-refine", "--run", run) == 0
    for command in ("view", "evaluate", "pushes"):
        assert "found no" in refused(command, "--run", run)
    capsys.readouterr()
    assert kinemimic("gait", "--run", run) == 0
    assert "simulated" not in capsys.readouterr().out.splitlines()[0]
    assert kinemimic("export", "--run", run, "--format", "csv") == 0
    assert "simulated" not in capsys.readouterr().out
    assert not (run / "report.html").exists() and (run / "outdated" / "1" / "report.html").exists()


@pytest.mark.parametrize("recorded", [True, False])
@pytest.mark.parametrize(
    ("file", "commands", "mend"),
    [
        ("motion.json", READERS, "retarget"),
        ("policy.safetensors", ("evaluate", "pushes"), "train"),
        ("capture.parquet", ("evaluate",), "retarget"),
        ("gait.json", ("train", "evaluate"), "retarget"),
        ("trajectory.npz", ("view", "gait", "export"), "evaluate"),
        ("scores.json", ("view",), "evaluate"),
    ],
)
def test_a_file_of_another_run(
    finished: dict[str, Path],
    run: Path,
    refused: Callable[..., str],
    recorded: bool,
    file: str,
    commands: tuple[str, ...],
    mend: str,
) -> None:
    for name in {file, "policy.json"} if file == "policy.safetensors" else {file}:
        shutil.copy(finished["run"] / name, run / name)
    if not recorded:
        # As in a folder of an earlier version: only the files themselves can tell.
        (run / "run.json").unlink()
        if file == "motion.json":
            # Which of all the files is the wrong one cannot be known.
            commands, mend = ("evaluate", "view"), ""
    for command in commands:
        assert f"{mend}" in refused(command, "--run", run)


def test_a_full_disk_changes_nothing(run: Path, refused: Callable[..., str]) -> None:
    """motion.json, which is written before the disk is full, does not stand beside the earlier files."""
    before = {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    written = (run / "motion.json").stat().st_size
    # motion.json fits, capture.parquet does not.
    resource.setrlimit(resource.RLIMIT_FSIZE, (written + 1000, limits[1]))
    try:
        text = refused("retarget", "--no-refine", "--ankle", "normal", "--run", run)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert text == f"kinemimic: {run / 'capture.parquet'}: file too large"
    assert {path: path.read_bytes() for path in run.rglob("*") if path.is_file()} == before


def test_another_seed_sets_the_scores_aside(run: Path, refused: Callable[..., str]) -> None:
    trained(run, action=0.01, seed=1)
    assert not (run / "scores.json").exists() and (run / "outdated" / "1" / "scores.json").exists()
    assert "run `evaluate` first" in refused("view", "--run", run)


@pytest.mark.parametrize(
    ("file", "command", "stage_that_writes_it"),
    [
        ("motion.json", "train", "retarget"),
        ("motion.json", "evaluate", "retarget"),
        ("policy.safetensors", "evaluate", "train"),
        ("policy.json", "evaluate", "train"),
        ("trajectory.npz", "view", "evaluate"),
        ("clip.parquet", "convert", "ingest"),
    ],
)
def test_a_deleted_file(
    run: Path, refused: Callable[..., str], file: str, command: str, stage_that_writes_it: str
) -> None:
    (run / file).unlink()
    text = refused(command, "--run", run)
    assert file in text and stage_that_writes_it in text


def test_files_of_an_earlier_version(
    run: Path, captures: dict[str, Path], refused: Callable[..., str]
) -> None:
    with np.load(run / "trajectory.npz") as arrays:
        older = {name: arrays[name] for name in arrays.files if name != "motion"} | {"schema": np.array(1)}
    np.savez(run / "trajectory.npz", **older)
    (run / "run.json").write_text('{"schema": 1, "stages": {}}')
    assert "expected a trajectory of schema 2, found 1; run `evaluate` again" in refused("view", "--run", run)
    assert "or of an earlier version; choose another --run, or add --overwrite" in refused(
        "ingest", captures["walk"], "--run", run
    )


def test_two_commands_at_once(run: Path, captures: dict[str, Path], refused: Callable[..., str]) -> None:
    # As another process would: the lock belongs to the open file.
    other = _lock(run)
    try:
        for command in (("run", captures["walk"]), ("retarget",), ("evaluate",), ("view",), ("gait",)):
            assert "in use by another kinemimic command; wait" in refused(*command, "--run", run)
    finally:
        os.close(other)
    assert kinemimic("gait", "--run", run) == 0
