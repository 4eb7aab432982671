"""Recordings of different sensors have one schema: they concatenate, and say what they are."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from kinemimic.pipeline.convert import convert, read_converted
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.clip_table import BLOCK, clip_schema, rotation_schema
from kinemimic.pipeline.files.store import read_clip, write_clip
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.orientation.rest_pose import node_rotations_of
from kinemimic.pipeline.kinematics.skeleton import NODES, Skeleton

RAW = Path(__file__).parents[3] / "datasets" / "versions" / "raw"


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """A Kinect's positions of 20 joints, and a BVH with Euler channels, filtered and not."""
    folder = tmp_path_factory.mktemp("runs")
    for name, capture, chosen in (
        ("kinect", "kinect_walk.skl", "kalman"),
        ("filtered", "kinect_walk_euler.bvh", "kalman"),
        ("channels", "kinect_walk_euler.bvh", "none"),
    ):
        ingest(RAW / capture, folder / name, filter_name=chosen)
        convert(folder / name)
    return sorted(folder.iterdir())


@pytest.mark.parametrize("name", ["raw", "clip", "quaternions"])
def test_recordings_of_different_sensors_have_the_same_columns(runs: list[Path], name: str) -> None:
    tables = [pq.read_table(run / f"{name}.parquet") for run in runs]
    schema = rotation_schema() if name == "quaternions" else clip_schema()
    assert all(table.schema.remove_metadata().equals(schema) for table in tables)
    assert pa.concat_tables(tables).num_rows == sum(map(len, tables))


def test_the_columns_are_the_nodes_and_their_angles(runs: list[Path]) -> None:
    for run in runs:
        clip, table = read_clip(run / "clip.parquet"), pd.read_parquet(run / "clip.parquet")
        positions, states = to_nodes(clip)
        shown = np.stack([table[[f"{n}_{axis}_m" for axis in "xyz"]].to_numpy() for n in NODES], axis=1)
        assert np.allclose(shown, positions, atol=1e-6, equal_nan=True)
        assert np.array_equal(np.stack([table[f"{n}_state"] for n in NODES], axis=1), states)
        for name, curve in leg_angles(positions).items():
            assert np.allclose(table[f"{name}_deg"], np.degrees(curve), atol=1e-4, equal_nan=True)
        assert np.array_equal(table["time_s"], clip.times) and np.array_equal(table["pass"], clip.passes)
        turns = pd.read_parquet(run / "quaternions.parquet")
        found = np.stack([turns[[f"{n}_q{axis}" for axis in "xyzw"]].to_numpy() for n in NODES], axis=1)
        expected = node_rotations_of(read_converted(run)).rotations
        if run.name == "kinect":
            expected = read_converted(run).rotations
        assert np.allclose(found, expected, atol=1e-6, equal_nan=True)


def test_a_missing_joint_is_null_in_the_columns_and_nan_in_the_lists(
    runs: list[Path], tmp_path: Path
) -> None:
    clip = read_clip(runs[0] / "clip.parquet")
    clip.positions[3, clip.skeleton.index("KneeLeft")] = np.nan
    write_clip(tmp_path / "a.parquet", clip)
    table = pq.read_table(tmp_path / "a.parquet")
    assert table["knee_left_x_m"].null_count == table["knee_left_deg"].null_count == 1
    assert table["joints_position_m"].combine_chunks().flatten().null_count == 0
    assert np.array_equal(read_clip(tmp_path / "a.parquet").positions, clip.positions, equal_nan=True)


def test_metadata_and_attrs_say_what_a_table_is(runs: list[Path]) -> None:
    path = runs[-1] / "clip.parquet"
    plain, attrs = pq.read_schema(path).metadata, pd.read_parquet(path).attrs
    assert attrs["recording"] == "kinect_walk.skl" and attrs["sensor"] == "virtual Kinect v1"
    assert attrs["simulated"] is True and attrs["joints"] == list(NODES)
    assert attrs["rate_hz"] == pytest.approx(read_clip(path).rate, abs=1e-5)
    assert attrs["frames"] == len(pd.read_parquet(path)) and "metres" in attrs["units"]
    for name, value in attrs.items():
        told = plain[f"kinemimic.{name}".encode()].decode()
        assert told == value if isinstance(value, str) else json.loads(told) == value


def test_every_row_names_its_recording(runs: list[Path]) -> None:
    both = pd.concat([pd.read_parquet(run / "clip.parquet") for run in runs])
    assert list(both["recording"].unique()) == ["kinect_walk_euler.bvh", "kinect_walk.skl"]
    assert both.groupby("recording")["recording_id"].nunique().eq(1).all()
    assert both["recording_id"].nunique() == 2 and both["recording_id"].str.len().eq(12).all()
    assert both["simulated"].all()


def test_convert_adds_rotations_and_repeats_nothing(runs: list[Path]) -> None:
    """A filtered capture has its rotations in clip.parquet, an unfiltered one gets them."""
    channels, filtered, kinect = runs
    for run, stored in ((channels, True), (filtered, False), (kinect, True)):
        table = pq.read_table(run / "quaternions.parquet")
        assert (table["joints_rotation_xyzw"].null_count == 0) is stored
        assert not [name for name in table.column_names if name.endswith("_m")]
        before = (run / "quaternions.parquet").read_bytes()
        converted = convert(run)
        assert (run / "quaternions.parquet").read_bytes() == before
        again = read_converted(run)
        assert np.array_equal(again.rotations, converted.rotations, equal_nan=True)
        assert again.skeleton.names == converted.skeleton.names
        assert np.array_equal(again.positions, converted.positions, equal_nan=True)


def test_rotations_of_another_clip_are_refused(runs: list[Path], tmp_path: Path) -> None:
    clip = (runs[0] / "clip.parquet").read_bytes()
    (tmp_path / "clip.parquet").write_bytes(clip)
    with pytest.raises(CaptureError, match=r"quaternions\.parquet: expected rotations, found no file"):
        read_converted(tmp_path)
    (tmp_path / "quaternions.parquet").write_bytes((runs[1] / "quaternions.parquet").read_bytes())
    with pytest.raises(CaptureError, match=r"found those of another clip; run `convert` again"):
        read_converted(tmp_path)
    (tmp_path / "quaternions.parquet").write_bytes(clip)
    with pytest.raises(
        CaptureError, match=r"expected rotations of `convert` \(Parquet\), found another table"
    ):
        read_converted(tmp_path)


def test_a_clip_of_no_body_has_empty_columns_and_comes_back(tmp_path: Path) -> None:
    """As many rows as are written in two blocks."""
    frames = BLOCK + 3
    positions = np.random.default_rng(0).normal(size=(frames, 2, 3))
    clip = Clip(
        Skeleton(("a", "b"), (-1, 0), np.zeros((2, 3))),
        np.arange(float(frames)),
        positions,
        np.full((frames, 2), 2, np.uint8),
        np.zeros(frames, np.int32),
        angles={"knee": positions[:, 0, 0].copy()},
    )
    write_clip(tmp_path / "a.parquet", clip)
    table = pq.read_table(tmp_path / "a.parquet")
    assert table["knee_left_x_m"].null_count == table["knee_left_deg"].null_count == frames
    back = read_clip(tmp_path / "a.parquet")
    assert np.array_equal(back.positions, positions) and np.array_equal(
        back.angles["knee"], clip.angles["knee"]
    )
