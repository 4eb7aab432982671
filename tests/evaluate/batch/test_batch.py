"""kinemimic batch: a row for every capture, whatever becomes of it; nothing is done twice."""

from __future__ import annotations

import csv
import json
import os
import re
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from peers.recordings import write_damaged, write_walk
from printed.documented import PAGE, documented_keys
from samples import uiprmd

from kinemimic.evaluate.batch.batch import batch, found_nothing
from kinemimic.evaluate.batch.row import motion_columns
from kinemimic.evaluate.batch.sources import run_folders
from kinemimic.evaluate.batch.state import BatchState
from kinemimic.evaluate.workflow.run import RUN_STAGES, run
from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import read_json
from kinemimic.pipeline.parallel.executor import InProcess
from kinemimic.pipeline.parallel.task_pool import Failure


@pytest.fixture
def recordings(tmp_path: Path) -> Path:
    """A walk, a damaged capture in a subfolder, and a text."""
    folder = tmp_path / "recordings"
    write_walk(folder / "walk.skl")
    write_damaged(folder / "more" / "broken.bvh")
    (folder / "notes.md").write_text("# Recorded in May\n")
    return folder


def by_name(result: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {Path(row["file"]).name: row for row in result["captures"]}


def status(*arguments: object) -> int | str | None:
    with pytest.raises(SystemExit) as exit_:
        main([str(one) for one in arguments])
    return exit_.value.code


def test_every_capture_has_a_row_and_a_run_folder(recordings: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = batch([recordings], out)
    assert result == read_json(out / "batch.json")
    rows = by_name(result)
    assert list(rows) == ["broken.bvh", "walk.skl"]
    assert list(result["other"]) == [str(recordings / "notes.md")]
    good, bad = rows["walk.skl"], rows["broken.bvh"]
    assert (good["status"], good["kind"], good["cyclic"], good["reason"]) == ("accepted", "walk", True, None)
    gait = read_json(out / "walk.skl" / "gait.json")
    assert (good["period_s"], good["speed_m_s"]) == (gait["period_s"], gait["speed_m_s"])
    assert good["strides_used"] > 2
    assert (bad["status"], bad["stage"], bad["kind"]) == ("refused", "ingest", None)
    assert bad["reason"].startswith("line ")
    assert not (out / "more" / "broken.bvh" / "raw.parquet").exists()
    assert result["counts"] == {
        "captures": 2,
        "accepted": 1,
        "loops": 1,
        "as_recorded": 0,
        "kinds": {"walk": 1},
        "performed": 0,
        "refused": {"ingest": 1},
        "failed": 0,
    }
    lines = list(csv.DictReader((out / "batch.csv").open()))
    assert [line["file"] for line in lines] == [row["file"] for row in result["captures"]]
    assert set(lines[0]) == set(good)


@pytest.mark.usefixtures("inline")
def test_run_continues_where_a_batch_ended(recordings: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    batch([recordings / "walk.skl"], out)
    again = run(recordings / "walk.skl", out / "walk.skl", stages=RUN_STAGES[:3], quiet=True)
    assert again.skipped == ("ingest", "convert", "retarget")


@pytest.mark.usefixtures("inline")
def test_what_is_up_to_date_is_not_done_again(recordings: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    first = batch([recordings], out)
    motion = out / "walk.skl" / "motion.json"

    def redone(**changes: Any) -> bool:
        # An age that no write has: the file system may give a new file the number of the old one.
        os.utime(motion, ns=(1, 1))
        batch([recordings], out, **changes)
        return motion.stat().st_mtime_ns != 1

    assert not redone()
    assert read_json(out / "batch.json") == first
    assert redone(overwrite=True)
    assert redone(options={"retarget": {"no-loop": True}})
    assert read_json(out / "batch.json")["counts"]["as_recorded"] == 1
    write_walk(recordings / "walk.skl", frames=180)
    assert redone(options={"retarget": {"no-loop": True}})
    motion.write_text("{}")
    assert redone(options={"retarget": {"no-loop": True}})


@pytest.mark.usefixtures("inline")
def test_no_old_motion_stands_beside_a_refusal(tmp_path: Path) -> None:
    capture, out = write_walk(tmp_path / "walk.skl"), tmp_path / "out"
    batch([capture], out)
    write_damaged(capture)
    assert by_name(batch([capture], out))["walk.skl"]["status"] == "refused"
    assert not list((out / "walk.skl").iterdir())


def test_a_capture_that_takes_too_long_is_a_row_and_is_tried_again(tmp_path: Path) -> None:
    capture, out = write_walk(tmp_path / "walk.skl"), tmp_path / "out"
    (row,) = batch([capture], out, timeout=0.01)["captures"]
    assert (row["status"], row["reason"]) == ("failed", "timed out after 0.01 s")
    assert batch([capture], out)["counts"]["accepted"] == 1


def test_a_crash_costs_one_row(tmp_path: Path) -> None:
    first, second = (write_walk(tmp_path / name) for name in ("a.skl", "b.skl"))

    class Crashing(InProcess):
        def map(self, work: Any, tasks: Any) -> Iterator[tuple[int, Any]]:
            _, other = tasks
            yield 1, work(other)
            yield 0, Failure("its process was ended by SIGSEGV")

    rows = by_name(batch([first, second], tmp_path / "out", executor=Crashing()))
    assert (rows["a.skl"]["status"], rows["a.skl"]["reason"]) == (
        "failed",
        "its process was ended by SIGSEGV",
    )
    assert rows["b.skl"]["status"] == "accepted"


def test_the_largest_captures_begin_first(tmp_path: Path) -> None:
    frames = {"a.skl": 40, "b.skl": 80, "c.skl": 60}
    captures = [write_walk(tmp_path / name, frames=count) for name, count in frames.items()]
    begun: list[str] = []

    class Watched(InProcess):
        def map(self, work: Any, tasks: Any) -> Iterator[tuple[int, Any]]:
            for number, task in enumerate(tasks):
                begun.append(task.capture.name)
                yield number, Failure("not carried out")

    result = batch(captures, tmp_path / "out", executor=Watched())
    assert begun == ["b.skl", "c.skl", "a.skl"]
    assert list(by_name(result)) == ["a.skl", "b.skl", "c.skl"]


def test_an_interrupted_batch_keeps_its_rows(tmp_path: Path) -> None:
    first, second = (write_walk(tmp_path / name) for name in ("a.skl", "b.skl"))
    out = tmp_path / "out"

    class Interrupted(InProcess):
        def map(self, work: Any, tasks: Any) -> Iterator[tuple[int, Any]]:
            yield 0, work(next(tasks))
            folder = next(tasks).folder
            folder.mkdir()
            (folder / ".clip.parquet.abc.parquet").touch()  # as a killed worker leaves it
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match="1 of 2 files done; run the same command again to resume"):
        batch([first, second], out, executor=Interrupted())
    kept = read_json(out / "batch.json")["captures"]
    assert [Path(row["file"]).name for row in kept] == ["a.skl"]
    assert not list((out / "b.skl").iterdir())
    assert batch([first, second], out)["captures"][0] == kept[0]
    assert read_json(out / "batch.json")["counts"]["accepted"] == 2


def test_run_folders_repeat_the_paths_and_leave_out_the_output(tmp_path: Path) -> None:
    folder = tmp_path / "all"
    names = ("one/walk.skl", "one/walk.bvh", "two/walk.skl")
    for name in (*names, "out/one/walk.skl/clip.parquet"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    out = folder / "out"
    expected = {folder / name: out / name for name in names}
    assert run_folders([folder], out) == expected
    assert run_folders([folder / "one", folder / "two" / "walk.skl"], out) == expected
    assert run_folders([folder / "two" / "walk.skl"], out) == {folder / "two/walk.skl": out / "walk.skl"}


def test_run_folders_of_sources_with_parent_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a/f.skl", "w/b/g.skl", "w/b/out/g.skl/motion.json", "far/away/h.skl"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path / "w")
    a, b, out = Path("../a"), Path("b"), Path("b/out")
    assert run_folders([a, b], Path("out")) == {
        a / "f.skl": Path("out/a/f.skl"),
        b / "g.skl": Path("out/w/b/g.skl"),
        b / "out/g.skl/motion.json": Path("out/w/b/out/g.skl/motion.json"),
    }
    assert run_folders([Path("../w/b")], out) == {Path("../w/b/g.skl"): out / "g.skl"}
    assert run_folders([b], Path("../w/b/out")) == {b / "g.skl": Path("../w/b/out/g.skl")}
    assert run_folders([Path("../w/b"), b], out) == {Path("../w/b/g.skl"): out / "g.skl"}
    Path("link").symlink_to(tmp_path / "far" / "away")
    assert run_folders([Path("link/../away")], out) == {Path("link/../away/h.skl"): out / "h.skl"}


def test_a_capture_has_one_name_however_its_path_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a/f.bvh", "a/g.bvh"):
        write_damaged(tmp_path / name)
    (tmp_path / "w").mkdir()
    monkeypatch.chdir(tmp_path / "w")
    out = Path("out")

    def names(*sources: Path) -> list[tuple[str, str]]:
        batch(sources, out, executor=InProcess())
        with BatchState(out) as state:
            return [(name, str(capture)) for name, (capture, _) in state.rows().items()]

    both = [(name, str(tmp_path / "a" / name)) for name in ("f.bvh", "g.bvh")]
    assert names(Path("../a")) == names(tmp_path / "a") == both
    with sqlite3.connect(out / "batch.sqlite") as rows:  # as earlier versions stored it
        rows.execute(
            "UPDATE captures SET capture = ? WHERE name = 'f.bvh'", (str(Path.cwd() / "../a/f.bvh"),)
        )
    assert [name for name, _ in names(tmp_path / "a")] == ["f.bvh", "g.bvh"]
    (tmp_path / "a" / "f.bvh").unlink()
    assert names(Path("../w/../a")) == both[1:]


@pytest.mark.usefixtures("inline")
def test_a_file_that_is_read_with_a_capture_has_no_row(tmp_path: Path) -> None:
    for name, content in uiprmd.files().items():
        (tmp_path / "in" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "in" / name).write_bytes(content)
    (row,) = batch([tmp_path / "in"], tmp_path / "out")["captures"]
    assert len(row["sidecar_files"]) == 1


def test_the_strides_and_the_path_come_from_the_report() -> None:
    gait = {
        "kind": "walk",
        "cyclic": True,
        "strides_used": 12,
        "strides_found": 20,
        "path": {"source": "feet", "disagreement": 0.4},
        "gate": [
            {"severity": "refuse", "message": "it sinks"},
            {"severity": "warn", "message": "it slips"},
        ],
        "warnings": ["the sensor turns", "it sinks", "it slips"],
    }
    row = motion_columns(gait)
    assert (row["strides_used"], row["strides_found"]) == (12, 20)
    assert (row["path"], row["path_disagreement"]) == ("feet", 0.4)
    assert (row["status"], row["stage"], row["reason"]) == ("refused", "gate", "it sinks")
    assert row["findings"] == ["the sensor turns", "it slips"]


def test_the_table_names_reasons_and_totals(
    recordings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status("batch", recordings, "--out", tmp_path / "out", "-j", 1) == 0
    text = capsys.readouterr().out
    assert re.search(r"walk\.skl +accepted +walk loop", text)
    assert re.search(r"more/broken\.bvh: line \d+", text)
    assert re.search(r"accepted +1 of 2: 1 loop, 0 as recorded", text)


def test_without_an_accepted_motion_the_status_is_2(
    recordings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status("batch", recordings / "more", "--out", tmp_path / "out", "--json") == 2
    assert json.loads(capsys.readouterr().out)["counts"]["captures"] == 1
    assert status("batch", recordings / "notes.md", "--out", tmp_path / "none") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "notes.md: expected captures, found none" in line
    assert status("batch", tmp_path / "absent", "--out", tmp_path / "none") == 2
    assert "absent: expected a capture or a folder of captures, found neither" in capsys.readouterr().err
    (tmp_path / "empty").mkdir()
    assert status("batch", tmp_path / "empty", "--out", tmp_path / "none") == 2
    assert "empty: expected captures, found none" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("files", "rest"),
    [
        (1, ""),
        (2, "; 1 other file is not a capture either"),
        (3, "; 2 other files are not captures either"),
    ],
)
def test_the_error_about_no_capture_counts_the_other_files(files: int, rest: str) -> None:
    error = found_nothing(["walks"], {"other": {f"{k}.txt": "a text" for k in range(files)}})
    assert str(error) == f"walks: expected captures, found none: a text{rest}"


@pytest.mark.usefixtures("inline")
def test_the_keys_of_the_table_are_documented(recordings: Path, tmp_path: Path) -> None:
    result = batch([recordings / "walk.skl"], tmp_path / "out")
    assert documented_keys("batch.json") == set(result)
    section = re.search(r"^## batch\.json\n(.*?)(?=^## )", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    assert section
    rows = re.findall(r"^\| (`.*?) \|", section[1], re.MULTILINE)
    documented = {name for names in rows for name in re.findall(r"`(\w+)`", names)}
    assert documented == set(result) | set(result["captures"][0])


def test_an_invalid_subject_is_refused_before_anything_is_processed(recordings: Path, tmp_path: Path) -> None:
    with pytest.raises(KinemimicError, match="--subject: expected a regular expression, found"):
        batch([recordings], tmp_path / "out", subject="[")
    assert not (tmp_path / "out").exists()
