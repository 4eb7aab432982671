"""Files are read back as written, and a failed write leaves nothing behind."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.files.store import (
    atomic,
    content_hash,
    copy_file,
    file_hash,
    read_clip,
    read_json,
    remove_leftovers,
    write_clip,
    write_json,
    write_text,
)
from kinemimic.pipeline.files.validation import tables
from kinemimic.pipeline.kinematics.clip import Clip, Label
from kinemimic.pipeline.kinematics.rotations import Y_UP_TO_Z_UP
from kinemimic.pipeline.kinematics.skeleton import Skeleton

Build = Callable[..., Clip]


def assert_same(a: Clip, b: Clip) -> None:
    for field in fields(Clip):
        left, right = getattr(a, field.name), getattr(b, field.name)
        if isinstance(left, np.ndarray):
            assert left.dtype == right.dtype
            assert np.array_equal(left, right, equal_nan=left.dtype.kind == "f")
        elif field.name == "skeleton":
            assert (left.names, left.parents) == (right.names, right.parents)
            assert np.array_equal(left.offsets, right.offsets)
        else:
            assert left == right


def rewrite_header(path: Path, change: Callable[[dict[str, Any]], object]) -> None:
    """Write the table again with a changed header."""
    table = pq.read_table(path)
    header = json.loads(table.schema.metadata[b"kinemimic"])
    change(header)
    pq.write_table(table.replace_schema_metadata({"kinemimic": json.dumps(header)}), path)


def test_clip_of_positions_comes_back(tmp_path: Path, node_clip: Build) -> None:
    clip = node_clip()
    clip.positions[3, 4] = np.nan
    clip.states[3, 4] = 0
    clip.passes[:5] = -1
    write_clip(tmp_path / "clip.parquet", clip)
    assert_same(clip, read_clip(tmp_path / "clip.parquet"))


def test_clip_of_rotations_comes_back(tmp_path: Path, node_clip: Build) -> None:
    clip = node_clip()
    rng = np.random.default_rng(0)
    clip = replace(
        clip,
        euler=rng.normal(size=(60, 20, 3)),
        orders=("ZYX",) * 19 + ("",),
        translations=rng.normal(size=(60, 20, 3)),
        rests=rng.normal(size=(20, 4)),
        rotations=rng.normal(size=(60, 20, 4)),
        world_from_file=Y_UP_TO_Z_UP,
    )
    write_clip(tmp_path / "clip.parquet", clip)
    assert_same(clip, read_clip(tmp_path / "clip.parquet"))


def test_labels_come_back_and_files_without_them_have_none(tmp_path: Path, node_clip: Build) -> None:
    path = tmp_path / "clip.parquet"
    clip = replace(node_clip(), labels=(Label("walk", 0.1, 1.0), Label("sitDown", 5.0, 5.0)))
    write_clip(path, clip)
    assert_same(clip, read_clip(path))
    rewrite_header(path, lambda header: header.pop("labels"))
    assert read_clip(path).labels == ()
    rewrite_header(path, lambda header: header.update(labels=[{"name": "walk", "start": 2.0, "end": 1.0}]))
    with pytest.raises(CaptureError, match="label 'walk' from 2 to 1 s"):
        read_clip(path)
    rewrite_header(path, lambda header: header.update(labels=["walk"]))
    with pytest.raises(CaptureError, match="the label 'walk'"):
        read_clip(path)


def test_same_clip_same_bytes(tmp_path: Path, node_clip: Build) -> None:
    write_clip(tmp_path / "a.parquet", node_clip())
    write_clip(tmp_path / "b.parquet", node_clip())
    assert file_hash(tmp_path / "a.parquet") == file_hash(tmp_path / "b.parquet")


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "result.json"
    write_text(target, "old")
    with pytest.raises(RuntimeError), atomic(target) as temporary:
        temporary.write_text("half of the n")
        raise RuntimeError
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_only_what_a_killed_process_left_of_a_file_is_removed(tmp_path: Path) -> None:
    kept = {"run.json", ".run.json", ".run.json.mine", ".run.json.abcdefgh.txt", ".other.json.abcdefgh.json"}
    for name in kept:
        (tmp_path / name).write_text("")
    with atomic(tmp_path / "run.json") as left:
        remove_leftovers(tmp_path / "run.json")
        assert not left.exists()
        left.write_text("")  # for the end of the block
    assert {path.name for path in tmp_path.iterdir()} == kept


def test_what_cannot_be_written_is_named(tmp_path: Path) -> None:
    target = tmp_path / "result.json"
    with pytest.raises(OSError, match="No space left") as full, atomic(target):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert full.value.filename == str(target)
    target.mkdir()
    with pytest.raises(IsADirectoryError) as folder:
        write_text(target, "")
    assert folder.value.filename == str(target)
    assert list(tmp_path.iterdir()) == [target]


def test_a_name_that_is_no_utf8_is_written(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", f"made of {os.fsdecode(bytes([0xC3, 0xA4, 0xFF]))}")
    assert (tmp_path / "a.txt").read_text(encoding="utf-8") == "made of ä\\udcff"


def test_a_folder_whose_name_is_no_utf8_holds_clips(tmp_path: Path, node_clip: Build) -> None:
    path = tmp_path / os.fsdecode(b"r\xff") / "clip.parquet"
    write_clip(path, node_clip())
    assert_same(node_clip(), read_clip(path))


def test_a_copy_that_has_no_source_leaves_the_old_file(tmp_path: Path) -> None:
    source, target = tmp_path / "source", tmp_path / "there" / "copy"
    source.write_bytes(b"\x00\xff")
    copy_file(source, target)
    source.unlink()
    with pytest.raises(FileNotFoundError):
        copy_file(source, target)
    assert [path.read_bytes() for path in target.parent.iterdir()] == [b"\x00\xff"]


def test_a_result_has_the_mode_of_any_other_file(tmp_path: Path) -> None:
    (tmp_path / "usual").touch()
    write_text(tmp_path / "ours", "")
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_json_keeps_its_sequence_and_refuses_nan(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", {"b": 1, "a": 2})
    assert list(read_json(tmp_path / "a.json")) == ["b", "a"]
    with pytest.raises(ValueError, match="JSON compliant"):
        write_json(tmp_path / "b.json", float("nan"))
    assert not (tmp_path / "b.json").exists()


@pytest.mark.parametrize("text", ["[" * 100_000, '{"x": NaN}', "[-Infinity]", "[1e999]", "{", "\udcff"])
def test_what_is_no_json_is_one_clear_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(text, encoding="utf-8", errors="surrogateescape")
    with pytest.raises(KinemimicError, match=r"a\.json: expected JSON, found "):
        read_json(path)


def test_json_that_never_ends_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "motion.json").symlink_to("/dev/zero")
    with pytest.raises(KinemimicError, match=r"motion\.json: expected a JSON file, found a pipe or a device"):
        read_json(tmp_path / "motion.json")


def test_content_hash_is_of_names_types_shapes_and_values() -> None:
    a = np.arange(6.0)
    hashes = {
        content_hash({"a": a}),
        content_hash({"b": a}),
        content_hash({"a": a.astype(np.float32)}),
        content_hash({"a": a.reshape(2, 3)}),
        content_hash({"a": a + 1}),
    }
    assert len(hashes) == 5
    two = {"a": a, "b": a + 1}
    assert content_hash(two) == content_hash(dict(reversed(two.items())))
    assert content_hash({"a": np.arange(12.0)[::2]}) == content_hash({"a": np.array([0.0, 2, 4, 6, 8, 10])})


def test_errors_name_the_file_and_what_to_do(tmp_path: Path, node_clip: Build) -> None:
    path = tmp_path / "clip.parquet"
    with pytest.raises(
        CaptureError, match=r"clip\.parquet: expected a clip, found no file; run `kinemimic ingest` first"
    ):
        read_clip(path)
    with pytest.raises(KinemimicError, match="run `kinemimic evaluate` first"):
        read_json(tmp_path / "scores.json")
    path.write_text("no table")
    with pytest.raises(CaptureError, match="expected a kinemimic clip"):
        read_clip(path)
    write_clip(path, node_clip())
    table = pq.read_table(path)
    header = json.loads(table.schema.metadata[b"kinemimic"]) | {"schema": 99}
    pq.write_table(table.replace_schema_metadata({"kinemimic": json.dumps(header)}), path)
    with pytest.raises(KinemimicError, match="a clip of schema 3, found 99, written by a later version"):
        read_clip(path)
    pq.write_table(table.replace_schema_metadata({}), path)
    with pytest.raises(CaptureError, match="expected a kinemimic clip"):
        read_clip(path)
    for other in ({"rate": 60.0}, []):
        pq.write_table(table.replace_schema_metadata({"kinemimic": json.dumps(other)}), path)
        with pytest.raises(CaptureError, match=r"expected a kinemimic clip .* found another table"):
            read_clip(path)


def test_a_clip_of_an_earlier_schema_is_refused(tmp_path: Path, node_clip: Build) -> None:
    path = tmp_path / "clip.parquet"
    write_clip(path, node_clip())
    rewrite_header(path, lambda header: header.update(schema=2))
    with pytest.raises(KinemimicError, match=r"a clip of schema 3, found 2; run `ingest` again"):
        read_clip(path)


def _column(name: str, values: Any) -> Callable[[pa.Table], pa.Table]:
    return lambda table: table.set_column(table.column_names.index(name), name, pa.array(values))


TWO_JOINTS = {"names": ["a", "b"], "parents": [-1, 0], "offsets": [[0, 0, 0]] * 2}
DAMAGED: dict[str, tuple[Callable[[pa.Table], pa.Table], dict[str, Any], str]] = {
    "no names": (lambda t: t, {"skeleton": {}}, "no key 'names'"),
    "a list": (lambda t: t, {"skeleton": []}, "a damaged file"),
    "a twin": (
        lambda t: t,
        {"skeleton": {"names": ["a", "a"], "parents": [-1, 0], "offsets": [[0, 0, 0]] * 2}},
        "joint names must be unique",
    ),
    "a cycle": (
        lambda t: t,
        {"skeleton": {"names": ["a", "b"], "parents": [1, 0], "offsets": [[0, 0, 0]] * 2}},
        "every parent must come before",
    ),
    "no joint": (
        lambda t: t,
        {"skeleton": {"names": ["a", "b"], "parents": [-1, -7], "offsets": [[0, 0, 0]] * 2}},
        "invalid parents",
    ),
    "orders": (lambda t: t, {"orders": ["QQQ"] * 20}, "the Euler orders"),
    "no rotation": (lambda t: t, {"world_from_file": [0, 0]}, "for a rotation from the file's axes"),
    "zero rotation": (lambda t: t, {"world_from_file": [0, 0, 0, 0]}, "for a rotation"),
    "provenance": (lambda t: t, {"provenance": "x"}, "the provenance 'x'"),
    "NaN": (lambda t: t, {"provenance": {"x": float("nan")}}, "not JSON compliant"),
    "no frames": (lambda t: t.slice(0, 0), {}, "no frames"),
    "no time": (lambda t: t.drop(["time_s"]), {}, "0 columns 'time_s'"),
    "nulls": (_column("time_s", [None] * 60), {}, "column 'time_s' with nulls"),
    "words": (_column("time_s", ["x"] * 60), {}, "column 'time_s' of string"),
    "NaN times": (_column("time_s", np.full(60, np.nan)), {}, "times that are not finite"),
    "backwards": (_column("time_s", np.arange(60.0)[::-1]), {}, "times must increase strictly"),
    "infinity": (_column("joints_position_m", [[np.inf] * 60] * 60), {}, "implausibly large"),
    "a short row": (_column("joints_position_m", [[0.0] * 60] * 59 + [[0.0]]), {}, "60 numbers in every row"),
    "a null row": (_column("joints_position_m", [[0.0] * 60] * 59 + [None]), {}, "60 numbers in every row"),
    "a null": (_column("joints_position_m", [[0.0] * 59 + [None]] * 60), {}, "60 numbers in every row"),
    "no lists": (_column("joints_position_m", np.zeros(60)), {}, "no column 'joints_position_m' of lists"),
    "lists of words": (_column("joints_position_m", [["a"] * 60] * 60), {}, "of list<"),
    "no pass": (lambda t: t.drop(["pass"]), {}, "0 columns 'pass'"),
    "no state": (lambda t: t.drop(["joints_state"]), {}, "no column 'joints_state'"),
    "no positions": (_column("joints_position_m", pa.nulls(60, pa.list_(pa.float64()))), {}, "no positions"),
    "other names": (lambda t: t, {"skeleton": TWO_JOINTS}, "6 numbers in every row"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_clip_is_one_clear_line(tmp_path: Path, node_clip: Build, name: str) -> None:
    path = tmp_path / "clip.parquet"
    change, header, found = DAMAGED[name]
    write_clip(path, node_clip())
    table = pq.read_table(path)
    told = json.dumps(json.loads(table.schema.metadata[b"kinemimic"]) | header)
    pq.write_table(change(table).replace_schema_metadata({"kinemimic": told}), path)
    with pytest.raises(
        CaptureError, match=r"clip\.parquet: expected a kinemimic clip \(Parquet\), found "
    ) as error:
        read_clip(path)
    assert found in str(error.value) and str(error.value).endswith("; run the stage that writes it again")


@pytest.mark.parametrize("told", ["[" * 100_000, "{", "\udcff"])
def test_a_clip_with_a_damaged_header_is_one_clear_line(tmp_path: Path, told: str) -> None:
    path = tmp_path / "clip.parquet"
    header = {b"kinemimic": told.encode("utf-8", "surrogateescape")}
    pq.write_table(pa.table({"time": [0.0]}).replace_schema_metadata(header), path)
    with pytest.raises(CaptureError, match=r"clip\.parquet: expected a kinemimic clip .*; run the stage"):
        read_clip(path)


def test_any_damage_to_a_clip_names_it(tmp_path: Path, node_clip: Build) -> None:
    path, random = tmp_path / "clip.parquet", np.random.default_rng(0)
    write_clip(path, node_clip())
    whole = np.frombuffer(path.read_bytes(), np.uint8)
    for _ in range(60):
        spoilt = whole.copy()
        # Most of it in the footer, which is what is believed.
        at = random.choice([random.integers(len(whole)), len(whole) - 1 - random.integers(8000)])
        spoilt[at] = random.integers(256)
        path.write_bytes(spoilt.tobytes())
        with suppress(KinemimicError):  # a value of a column may be another
            read_clip(path)
        with pytest.raises(CaptureError, match=r"clip\.parquet: expected a kinemimic clip"):
            path.write_bytes(spoilt[: random.integers(len(spoilt))].tobytes())
            read_clip(path)


def test_a_table_of_more_than_fits_is_not_read(
    tmp_path: Path, node_clip: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_clip(tmp_path / "clip.parquet", node_clip())
    monkeypatch.setattr(tables, "_CELLS", 60 * 96 - 1)
    with pytest.raises(CaptureError, match="found 60 rows of 96 columns, more than fit into memory"):
        read_clip(tmp_path / "clip.parquet")
    wide = Skeleton(tuple(map(str, range(40))), (-1, *[0] * 39), np.zeros((40, 3)))
    clip = Clip(
        wide, np.arange(60.0), np.zeros((60, 40, 3)), np.zeros((60, 40), np.uint8), np.zeros(60, np.int32)
    )
    write_clip(tmp_path / "clip.parquet", clip)
    monkeypatch.setattr(tables, "_CELLS", 60 * 96)
    with pytest.raises(CaptureError, match="found 60 rows of 120 numbers, more than fit into memory"):
        read_clip(tmp_path / "clip.parquet")
