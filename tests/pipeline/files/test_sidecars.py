"""Sidecar files of a capture: read back as written, older ones upgraded, damaged ones refused."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.sidecars import (
    NOTE_SCHEMA,
    TRUTH_SCHEMA,
    beside,
    note_path,
    read_note,
    read_truth,
    truth_path,
    write_note,
    write_truth,
)
from kinemimic.pipeline.kinematics.angles import ANGLES

COLUMNS = {name: [0.1] for name in ("time", "pass", *ANGLES)}


def test_they_stand_beside_the_capture() -> None:
    assert truth_path(Path("a/walk.skl")) == Path("a/walk.truth.parquet")
    assert note_path(Path("a/walk.skl")) == Path("a/walk.provenance.json")
    assert truth_path(Path("a/walk.skl.gz")) == Path("a/walk.truth.parquet")
    assert note_path(Path("a/walk")) == Path("a/walk.provenance.json")


def test_what_is_read_with_a_capture_is_in_its_folder_or_in_one_beside_it() -> None:
    assert beside(Path("a/walk.csv"), "walk.toml") == Path("a/walk.toml")
    assert beside(Path("a/b/walk.csv"), "../c/walk.csv") == Path("a/c/walk.csv")
    assert beside(Path("walk.csv"), "../c/walk.csv") == Path("../c/walk.csv")
    for name in ("../walk.csv", "../../walk.csv", "../c/..", "../c/d/walk.csv", "c/walk.csv", "/walk.csv"):
        with pytest.raises(ValueError, match=r"expected a file|Invalid name"):
            beside(Path("a/b/walk.csv"), name)


def test_a_truth_comes_back_and_says_its_schema(tmp_path: Path) -> None:
    path, times = tmp_path / "a.truth.parquet", np.arange(5) / 30.0
    angles = {name: times + k for k, name in enumerate(ANGLES)}
    write_truth(path, times, np.zeros(5, dtype=np.int64), angles, {"simulated": True})
    again = read_truth(path)
    assert again is not None and again.keys() == {"time", *ANGLES}
    for name, curve in {"time": times, **angles}.items():
        np.testing.assert_array_equal(again[name], curve)
    header = json.loads(pq.read_schema(path).metadata[b"kinemimic"])
    assert header == {"schema": TRUTH_SCHEMA, "provenance": {"simulated": True}}
    assert read_truth(tmp_path / "b.truth.parquet") is None


def _table(path: Path, header: object, columns: Mapping[str, list[Any]] = COLUMNS) -> Path:
    table = pa.table(dict(columns))
    if header is not None:
        table = table.replace_schema_metadata({"kinemimic": json.dumps(header)})
    pq.write_table(table, path)
    return path


@pytest.mark.parametrize("header", [None, {"provenance": {}}])
def test_a_truth_of_before_there_were_schemas_is_read(tmp_path: Path, header: object) -> None:
    truth = read_truth(_table(tmp_path / "a.truth.parquet", header))
    assert truth is not None and truth["knee_left"].tolist() == [0.1]


def test_a_later_truth_and_another_file_are_told(tmp_path: Path) -> None:
    path = tmp_path / "a.truth.parquet"
    with pytest.raises(KinemimicError, match=r"a\.truth\.parquet: expected the truth .* later version"):
        read_truth(_table(path, {"schema": TRUTH_SCHEMA + 1}))
    with pytest.raises(KinemimicError, match=r"found no column knee_right, hip_left, hip_right"):
        read_truth(_table(path, None, {"time": [0.1], "knee_left": [0.1]}))
    for damaged in (
        {"time": ["x"]},
        {"time": [None]},
        {"time": [float("nan")] * 2, "hip_left": [0.1, 0.1]},
        {"knee_left": [None]},
    ):
        rows = max(len(values) for values in damaged.values())
        table = {**{name: [0.1] * rows for name in COLUMNS}, **damaged}
        with pytest.raises(KinemimicError, match=r"a\.truth\.parquet: expected .*; record it again"):
            read_truth(_table(path, None, table))
    path.write_text("truth")
    with pytest.raises(KinemimicError, match=r"expected the truth of a simulated capture, found"):
        read_truth(path)


def test_a_note_comes_back_without_the_number_that_its_file_has(tmp_path: Path) -> None:
    path = tmp_path / "a.provenance.json"
    write_note(path, {"simulated": True})
    assert json.loads(path.read_text()) == {"schema": NOTE_SCHEMA, "simulated": True}
    assert read_note(path) == {"simulated": True}
    assert read_note(tmp_path / "b.provenance.json") == {}


def test_a_note_by_hand_is_read_and_a_wrong_one_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.provenance.json"
    path.write_text('{"who": "me"}')
    assert read_note(path) == {"who": "me"}
    path.write_text("[]")
    with pytest.raises(KinemimicError, match="expected a JSON object about the capture, found list"):
        read_note(path)
    path.write_text('{"schema": 2}')
    with pytest.raises(KinemimicError, match="later version"):
        read_note(path)
