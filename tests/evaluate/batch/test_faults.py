"""kinemimic batch: captures that take their process down, batches that are killed, and several at once."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from peers.faults import FaultyProcesses
from peers.holding import held_elsewhere
from peers.killing import finish, kill_after, kill_at, start
from peers.recordings import write_walk

from kinemimic.evaluate.batch import capture as capture_module
from kinemimic.evaluate.batch.batch import batch
from kinemimic.evaluate.batch.state import BatchState
from kinemimic.pipeline.parallel.executor import InProcess
from kinemimic.pipeline.parallel.task_pool import Failure


def files_of(folder: Path) -> dict[str, bytes]:
    """The data set: relative path -> bytes."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted((folder / "dataset").rglob("*"))
        if path.is_file()
    }


def check_sums(folder: Path) -> None:
    subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=folder / "dataset", check=True)


def test_every_fault_is_a_row_with_its_reason(tmp_path: Path) -> None:
    names = ("crash_1", "disk_1", "memory_1", "sound_1")
    captures = [write_walk(tmp_path / "in" / f"{name}.skl") for name in names]
    out = tmp_path / "out"
    rows = batch([tmp_path / "in"], out, executor=FaultyProcesses())["captures"]
    told = {Path(row["file"]).stem: (row["status"], row["reason"]) for row in rows}
    assert told["crash_1"] == ("failed", "its process was ended by SIGSEGV")
    assert told["memory_1"] == ("failed", "it takes more than 4 GiB of memory")
    assert told["disk_1"][0] == "failed"
    assert "file too large" in str(told["disk_1"][1])
    assert told["sound_1"] == ("accepted", None)
    assert not list((out / "disk_1.skl").glob("*"))
    check_sums(out)
    index = pq.read_table(out / "dataset" / "index.parquet").to_pydict()
    assert dict(zip(index["name"], index["status"], strict=True)) == {
        file.name: told[file.stem][0] for file in captures
    }


def test_a_capture_that_hangs_is_given_up(tmp_path: Path) -> None:
    write_walk(tmp_path / "hang_1.skl")
    (row,) = batch([tmp_path / "hang_1.skl"], tmp_path / "out", executor=FaultyProcesses(2.0))["captures"]
    assert (row["status"], row["reason"]) == ("failed", "timed out after 2 s")


def test_a_run_folder_that_another_process_holds_stays_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(capture_module, "_PATIENCE", 0.2)
    capture, out = write_walk(tmp_path / "walk.skl"), tmp_path / "out"
    batch([capture], out, executor=InProcess())
    folder = out / "walk.skl"
    before = {path: path.read_bytes() for path in folder.iterdir()}

    class Failing(InProcess):
        def map(self, work: Any, tasks: Any) -> Iterator[tuple[int, Any]]:
            return ((index, Failure("timed out after 1 s")) for index, _ in enumerate(tasks))

    class Interrupted(InProcess):
        def map(self, work: Any, tasks: Any) -> Iterator[tuple[int, Any]]:
            next(tasks)
            raise KeyboardInterrupt

    with held_elsewhere(folder):
        (row,) = batch([capture], out, executor=InProcess(), overwrite=True)["captures"]
        assert (row["status"], row["reason"]) == (
            "failed",
            "its run folder is in use by another process; run the batch again when that process has ended",
        )
        (row,) = batch([capture], out, executor=Failing(), overwrite=True)["captures"]
        assert row["reason"] == "timed out after 1 s"
        with pytest.raises(KeyboardInterrupt):
            batch([capture], out, executor=Interrupted(), overwrite=True)
        assert {path: path.read_bytes() for path in folder.iterdir()} == before
    (row,) = batch([capture], out, executor=Failing(), overwrite=True)["captures"]
    assert not list(folder.iterdir())
    assert batch([capture], out, executor=InProcess())["counts"]["accepted"] == 1


def kill_and_compare(folder: Path, captures: int, rows: int, times: int = 0) -> None:
    """A batch killed so many times when it has stored a row, then after so many times, some after its end."""
    for k in range(captures):
        write_walk(folder / "in" / f"p{k}_walk.skl", frames=150 + 3 * k)
    straight, killed = folder / "straight", folder / "killed"
    seconds = finish("batch", folder / "in", "--out", straight, "-j", "1").seconds
    random = np.random.default_rng(captures)
    done: dict[str, int] = {}  # name -> time at which its motion was written

    def check() -> None:
        with BatchState(killed) as state:
            for name in state.rows():
                time = (killed / name / "motion.json").stat().st_mtime_ns
                assert done.setdefault(name, time) == time, f"{name} was done twice"
        if (killed / "dataset").exists():
            check_sums(killed)

    for count in range(1, rows + 1):
        kill_at(1, "batch", folder / "in", "--out", killed, "-j", "1")
        check()
        assert len(done) == count < captures
    for _ in range(times):
        kill_after(random.uniform(0.2, 1.0) * seconds, "batch", folder / "in", "--out", killed, "-j", "1")
        check()
    finish("batch", folder / "in", "--out", killed, "-j", "1")
    for name, time in done.items():
        assert (killed / name / "motion.json").stat().st_mtime_ns == time, f"{name} was done twice"
    assert files_of(killed) == files_of(straight)
    assert len(pq.read_table(killed / "dataset" / "index.parquet")) == captures


def test_a_killed_batch_goes_on(tmp_path: Path) -> None:
    kill_and_compare(tmp_path, captures=2, rows=1)


@pytest.mark.slow
def test_a_batch_that_is_killed_at_any_moment_goes_on(tmp_path: Path) -> None:
    kill_and_compare(tmp_path, captures=8, rows=5, times=15)


@pytest.mark.slow
def test_two_batches_into_one_folder(tmp_path: Path) -> None:
    for name in ("a/x_1.skl", "a/y_1.skl", "b/x_1.skl", "b/z_1.skl"):
        write_walk(tmp_path / name)
    out = tmp_path / "out"
    sources = (("a",), ("b",), ("a",))
    running = [
        start("batch", *(tmp_path / one for one in given), "--out", out, "-j", "1") for given in sources
    ]
    for process in running:
        _, error = process.communicate()
        assert process.returncode == 0, error
    check_sums(out)
    index = pq.read_table(out / "dataset" / "index.parquet").to_pydict()
    assert len(index["name"]) == 4
    assert set(index["status"]) == {"accepted"}
    with BatchState(out) as state:
        captures = sorted(capture for capture, _ in state.rows().values())
    assert captures == sorted(tmp_path.glob("[ab]/*.skl"))
