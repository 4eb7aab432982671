"""The data set of a batch: complete, the same bytes from every executor, and compared motion by motion."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from peers.recordings import write_damaged, write_walk

from kinemimic.evaluate.batch.batch import batch
from kinemimic.evaluate.batch.sources import paths_of
from kinemimic.evaluate.batch.state import BatchState
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import write_json
from kinemimic.pipeline.parallel import packed_files
from kinemimic.pipeline.parallel.executor import InProcess
from kinemimic.retarget.dataset.columns import FRAME_COLUMNS, INDEX_COLUMNS
from kinemimic.retarget.dataset.index_table import motion_of, read_rows
from kinemimic.retarget.dataset.shards import ShardWriter
from kinemimic.retarget.dataset.split import SPLITS, split_of, subject_of, subject_pattern
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.versions.dataset_diff import dataset_changes


@dataclass(frozen=True)
class Elsewhere(InProcess):
    """As on a machine without a disk in common: tasks and results are bytes."""

    shares_disk: bool = False


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data") / "recordings"
    write_walk(folder / "ann_1.skl")
    write_walk(folder / "ann_2.skl", frames=170)
    write_damaged(folder / "bob_1.bvh")
    write_json(folder / "ann_2.provenance.json", {"licence": "CC-BY-4.0", "subject": "cleo"})
    return folder


@pytest.fixture(scope="module")
def out(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "out"
    batch([recordings], folder, executor=InProcess())
    return folder


def files_of(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_the_index_has_every_capture_and_the_shards_every_motion(out: Path) -> None:
    rows = read_rows(out / "dataset")
    assert [(name, row["status"]) for name, row in rows.items()] == [
        ("ann_1.skl", "accepted"),
        ("ann_2.skl", "accepted"),
        ("bob_1.bvh", "refused"),
    ]
    assert [rows[name]["subject"] for name in rows] == ["ann", "cleo", "bob"]
    assert rows["ann_2.skl"]["licence"] == "CC-BY-4.0"
    for name in ("ann_1.skl", "ann_2.skl"):
        row, motion = rows[name], read_motion_json(out / name / "motion.json")
        found = motion_of(out / "dataset", row)
        assert (row["motion"], found.cyclic, found.rate) == (motion.identity, motion.cyclic, motion.rate)
        np.testing.assert_allclose(found.root, motion.root, atol=1e-6)
        np.testing.assert_allclose(found.rotations, motion.rotations, atol=1e-6)
        np.testing.assert_array_equal(found.contacts, motion.contacts)
        assert row["split"] == split_of(row["subject"]) == Path(row["shard"]).name.partition("-")[0]


def test_tasks_that_travel_as_bytes_give_the_same_bytes(recordings: Path, out: Path, tmp_path: Path) -> None:
    batch([recordings], tmp_path / "other", executor=Elsewhere())
    assert files_of(tmp_path / "other" / "dataset") == files_of(out / "dataset")
    there, here = files_of(tmp_path / "other" / "ann_1.skl"), files_of(out / "ann_1.skl")
    # A recording for viewers has the time at which it was written.
    assert {name for name in here if here[name] != there[name]} <= {"motion.mcap", "run.json"}


def test_what_another_machine_returns_stays_in_the_run_folder(tmp_path: Path) -> None:
    """A row with its reason, and nothing of it in any folder; the other captures are not touched."""

    class Strange(Elsewhere):
        def map(self, work: Any, tasks: Any) -> Iterator[tuple[int, Any]]:
            for index, result in super().map(work, tasks):
                files = result.files | ({"../../stolen": b"x"} if index == 0 else {})
                yield index, replace(result, files=files)

    captures = [write_walk(tmp_path / "in" / name) for name in ("a_1.skl", "b_1.skl")]
    first, second = batch(captures, tmp_path / "out", executor=Strange())["captures"]
    assert (first["status"], second["status"]) == ("failed", "accepted")
    assert "expected names of files below it from another machine" in first["reason"]
    assert not list((tmp_path / "out" / "a_1.skl").glob("*"))
    assert not list(tmp_path.rglob("stolen"))


def test_a_capture_that_is_too_much_to_send_is_a_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packed_files, "MOST_BYTES", 1000)
    (row,) = batch([write_walk(tmp_path / "a_1.skl")], tmp_path / "out", executor=Elsewhere())["captures"]
    assert row["status"] == "failed"
    assert "expected files for another machine, in all of at most" in row["reason"]


def test_nothing_is_made_again_and_what_is_damaged_is(recordings: Path, out: Path, tmp_path: Path) -> None:
    index = out / "dataset" / "index.parquet"
    before = index.stat().st_mtime_ns
    batch([recordings], out, executor=InProcess())
    assert index.stat().st_mtime_ns == before
    whole = files_of(out / "dataset")
    next((out / "dataset" / "motions").iterdir()).unlink()
    batch([recordings], out, executor=InProcess())
    assert files_of(out / "dataset") == whole


def test_two_data_sets_differ_as_motions(recordings: Path, out: Path, tmp_path: Path) -> None:
    options = {"retarget": {"no-refine": True}}
    batch(
        [recordings / "ann_1.skl", recordings / "bob_1.bvh"],
        tmp_path / "b",
        options=options,
        executor=InProcess(),
    )
    assert dataset_changes(out / "dataset", out / "dataset") == {}
    found = dataset_changes(out / "dataset", tmp_path / "b" / "dataset")
    assert list(found) == ["ann_1.skl", "ann_2.skl"]
    assert found["ann_2.skl"] == "removed"
    assert any(change.unit == "°" for change in found["ann_1.skl"] if not isinstance(change, str))


def test_the_page_stands_alone_and_shows_every_capture(out: Path) -> None:
    page = (out / "index.html").read_text()
    assert "http" not in page.replace("http://www.w3.org/2000/svg", "")
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert data
    rows = {row["name"]: row for row in json.loads(data[1])}
    assert list(rows) == ["ann_1.skl", "ann_2.skl", "bob_1.bvh"]
    assert len(rows["ann_1.skl"]["poses"]) == 3
    assert set(rows["ann_1.skl"]["curves"]) == {"knee_left", "knee_right", "hip_left", "hip_right"}


def test_a_name_cannot_leave_its_place_on_the_page(tmp_path: Path) -> None:
    write_damaged(tmp_path / "in" / "<script>alert(1)<" / "x.bvh")
    batch([tmp_path / "in"], tmp_path / "out", executor=InProcess())
    assert "<script>alert" not in (tmp_path / "out" / "index.html").read_text()


def test_all_columns_are_there(out: Path) -> None:
    assert pq.read_schema(out / "dataset" / "index.parquet").names == list(INDEX_COLUMNS)
    shard = next((out / "dataset" / "motions").iterdir())
    assert pq.read_schema(shard).names == list(FRAME_COLUMNS)


def test_shards_are_bounded_and_a_motion_is_in_one(out: Path, tmp_path: Path) -> None:
    motion = read_motion_json(out / "ann_1.skl" / "motion.json")
    writer = ShardWriter(tmp_path, "train", most=2 * len(motion.root) + 1)
    shards = [writer.add(f"m{k}", "ann", "walk", motion) for k in range(5)]
    writer.close()
    assert shards == [f"motions/train-{k:05d}.parquet" for k in (0, 0, 1, 1, 2)]
    for shard in set(shards):
        names = pq.read_table(tmp_path / shard)["motion"].unique().to_pylist()
        assert names == [f"m{k}" for k in range(5) if shards[k] == shard]


def test_a_split_depends_on_the_person_alone() -> None:
    splits = [split_of(f"person {k}") for k in range(2000)]
    shares = [splits.count(split) / 2000 for split in SPLITS]
    np.testing.assert_allclose(shares, [0.8, 0.1, 0.1], atol=0.03)
    pattern = subject_pattern(None)
    assert [subject_of(name, pattern) for name in ("a/p1_2.skl", "b/p1_3.bvh.gz", "walk.bvh")] == [
        "p1",
        "p1",
        "walk",
    ]
    assert subject_of("Person001_1.txt", subject_pattern(r"(Person\d)")) == "Person0"
    with pytest.raises(KinemimicError, match="expected a regular expression"):
        subject_pattern("(")


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP])
def test_on_a_file_system_without_locks_every_capture_is_free(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "lockf", refuse)
    capture = write_damaged(tmp_path / "x.bvh")
    assert batch([capture], tmp_path / "out", executor=InProcess())["counts"]["refused"] == {"ingest": 1}


def test_a_capture_that_is_gone_leaves_and_one_of_another_batch_stays(tmp_path: Path) -> None:
    for name in ("a/x.bvh", "a/y.bvh", "b/x.bvh"):
        write_damaged(tmp_path / name)
    out = tmp_path / "out"

    def names() -> Iterator[str]:
        with BatchState(out) as state:
            yield from (str(capture.relative_to(tmp_path)) for capture, _ in state.rows().values())

    for source in ("a", "b"):
        batch([tmp_path / source], out, executor=InProcess())
    assert sorted(names()) == ["a/x.bvh", "a/y.bvh", "b/x.bvh"]
    (tmp_path / "a" / "y.bvh").unlink()
    batch([tmp_path / "a"], out, executor=InProcess())
    assert sorted(names()) == ["a/x.bvh", "b/x.bvh"]


def test_a_motion_that_another_batch_makes_again_is_left_out_until_then(tmp_path: Path) -> None:
    first, second = (write_walk(tmp_path / name) for name in ("a_1.skl", "b_1.skl"))
    out = tmp_path / "out"
    motion = out / "a_1.skl" / "motion.json"

    def names(*captures: Path) -> list[str]:
        batch(captures, out, executor=InProcess())
        return [*read_rows(out / "dataset")]

    assert names(first, second) == ["a_1.skl", "b_1.skl"]
    for frames, spoil in ((170, motion.unlink), (180, lambda: motion.write_text("{}"))):
        write_walk(second, frames=frames)
        spoil()
        assert names(second) == ["b_1.skl"]
        assert names(first, second) == ["a_1.skl", "b_1.skl"]
    write_walk(second, frames=190)
    motion.unlink()
    assert names(second) == ["b_1.skl"]
    # The row and the motion come back as they were.
    batch([first], out, executor=InProcess(), dataset=False)
    assert names(second) == ["a_1.skl", "b_1.skl"]


def test_sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a/x.bvh", "a/b/y.bvh"):
        write_damaged(tmp_path / name)
    monkeypatch.chdir(tmp_path)
    Path("list.txt").write_text("# walks\na/x.bvh\n\na/**/y.bvh\n")
    assert paths_of(["a/**/*.bvh"]) == [Path("a/b/y.bvh"), Path("a/x.bvh")]
    assert paths_of(["@list.txt"]) == [Path("a/x.bvh"), Path("a/b/y.bvh")]
    Path("wrong.txt").write_text("a/x.bvh\nnowhere\n")
    wrong: list[tuple[Any, str]] = [
        (["@wrong.txt"], r"wrong.txt, line 2: nowhere: expected a capture"),
        (["@none.txt"], "none.txt: expected a list of sources, found no file"),
        (["a/*.skl"], "found nothing that matches the pattern"),
        (["kinect1_bernstein_skl"], "kinemimic datasets fetch kinect1_bernstein_skl"),
    ]
    monkeypatch.setenv("KINEMIMIC_CAPTURES", str(tmp_path / "none"))
    for sources, message in wrong:
        with pytest.raises(KinemimicError, match=message):
            paths_of(sources)
