"""Files: what is written comes back, and a failure leaves nothing behind."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.rotations import Y_UP_TO_Z_UP
from kinemimic.pipeline.store import (
    atomic,
    content_hash,
    copy_file,
    file_hash,
    read_clip,
    read_json,
    write_clip,
    write_json,
    write_text,
)

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
        CaptureError, match=r"clip\.parquet: expected a clip, found no file; run the stage before"
    ):
        read_clip(path)
    with pytest.raises(KinemimicError, match="run the stage that writes it"):
        read_json(tmp_path / "none.json")
    path.write_text("no table")
    with pytest.raises(CaptureError, match="expected a kinemimic clip"):
        read_clip(path)
    write_clip(path, node_clip())
    table = pq.read_table(path)
    header = json.loads(table.schema.metadata[b"kinemimic"]) | {"schema": 99}
    pq.write_table(table.replace_schema_metadata({"kinemimic": json.dumps(header)}), path)
    with pytest.raises(KinemimicError, match="a clip of schema 1, found 99, which a later version"):
        read_clip(path)
    pq.write_table(table.replace_schema_metadata({}), path)
    with pytest.raises(CaptureError, match="expected a kinemimic clip"):
        read_clip(path)
    for other in ({"rate": 60.0}, []):
        pq.write_table(table.replace_schema_metadata({"kinemimic": json.dumps(other)}), path)
        with pytest.raises(CaptureError, match=r"expected a kinemimic clip .* found another table of ours"):
            read_clip(path)
