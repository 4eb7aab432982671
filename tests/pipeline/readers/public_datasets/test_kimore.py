"""KIMORE CSV: the written walk is reproduced; published takes have their documented properties."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import kimore as sample
from samples import source_of
from samples.motion import in_sight, kinect_v2_joints, walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK
from kinemimic.pipeline.readers.public_datasets import kimore

TAKE = sample.files()["JointPosition.csv"].decode()
# The file's x, y, z are our y, z, x.
EXPECTED = (kinect_v2_joints(in_sight(walk(90))) + sample.SENSOR[[2, 0, 1]])[:, FROM_SDK]


def read(text: str) -> Clip:
    return recognise.read_source(source_of(text, Path("take.csv")))


def length(clip: Clip, start: str, end: str) -> float:
    bone = clip.positions[:, clip.skeleton.index(end)] - clip.positions[:, clip.skeleton.index(start)]
    return float(np.nanmedian(np.linalg.norm(bone, axis=-1)))


def test_the_written_walk_comes_back() -> None:
    clip = read(TAKE)
    assert clip.provenance["format"] == "KIMORE CSV"
    assert np.abs(clip.positions - EXPECTED).max() < 1e-5
    assert np.array_equal(clip.times, np.arange(90) / 30.0)
    assert (clip.states == 2).all()
    assert any("5 empty lines at the start" in note for note in clip.provenance["reading"]["notes"])


def test_a_smoothed_copy() -> None:
    clip = read(sample.smoothed().decode())
    assert np.abs(clip.positions - EXPECTED).max() < 1e-5
    assert (clip.states == 2).all()
    assert any("smoothed" in note for note in clip.provenance["reading"]["notes"])


def test_an_empty_line_among_the_frames_takes_its_time() -> None:
    lines = TAKE.strip().split("\n")
    lines[10:12] = ["", ""]
    clip = read("\n".join(lines))
    assert len(clip.times) == 88
    assert np.isclose(clip.times[10] - clip.times[9], 3 / 30)
    assert any("2 empty lines between" in note for note in clip.provenance["reading"]["notes"])


def test_a_spreadsheet_writes_commas_into_empty_lines() -> None:
    rows = TAKE.split("\n")
    assert not rows[0]
    commas = "\n".join("," * 100 if not row and k < len(rows) - 1 else row for k, row in enumerate(rows))
    clip, same = read(commas), read(TAKE)
    assert np.array_equal(clip.positions, same.positions, equal_nan=True)
    assert np.array_equal(clip.times, same.times)


@pytest.mark.parametrize(
    ("line", "change", "says"),
    [
        (20, lambda row: row[:-40], r"line 21: expected 100 numbers, found 9\d"),
        (20, lambda row: "x" + row[1:], "line 21: expected a number"),
        (20, lambda row: "1e9" + row[row.index(",") :], r"line 21: expected at most 100 m.*1e\+09"),
        (20, lambda row: row[:-2] + "3,", "line 21: expected a state of ThumbRight, 0, 1 or 2, found 3"),
        (94, lambda row: row[:100], "cut off there"),
        (5, lambda row: row[:100], r"line 6: expected 100 numbers, found 1\d"),
    ],
)
def test_damage(line: int, change, says: str) -> None:  # type: ignore[no-untyped-def]
    lines = TAKE.split("\n")
    lines[line] = change(lines[line])
    with pytest.raises(CaptureError, match=says):
        read("\n".join(lines))


def test_a_joint_at_the_origin_or_of_no_state_is_missing() -> None:
    lines = TAKE.strip().split("\n")
    row = lines[3].split(",")
    row[4:8] = ["0", "0", "0", "2"]
    row[8:12] = ["nan", "0.1", "2", "2"]
    row[11] = "0"
    lines[3] = ",".join(row)
    clip = read("\n".join(lines))
    assert np.flatnonzero(clip.states[3] == 0).tolist() == [1, clip.skeleton.index("Neck")]
    assert np.isnan(clip.positions[3, 1]).all()


def test_the_published_takes(captures: Path) -> None:
    folder = captures / "kinect2_kimore"
    for name, frames, empty in (("1", 505, 24), ("3", 1031, 18), ("5", 517, 19)):
        clip = recognise.read(folder / f"JointPositionExercise{name}.csv")
        assert clip.provenance["format"] == kimore.FORMAT.name
        assert len(clip.times) == frames
        assert any(f"{empty} empty" in note for note in clip.provenance["reading"]["notes"])
    # Arm lifts, standing: the person's legs.
    standing = recognise.read(folder / "JointPositionExercise1.csv")
    for side in ("Left", "Right"):
        assert 0.30 < length(standing, f"Hip{side}", f"Knee{side}") < 0.35
        assert 0.31 < length(standing, f"Knee{side}", f"Ankle{side}") < 0.35
    knees = leg_angles(to_nodes(standing)[0])
    assert np.nanmax(np.abs(np.degrees(knees["knee_left"]))) < 30
    # The take that SOURCE.txt calls badly tracked: the same person's thighs a quarter shorter.
    squat = recognise.read(folder / "JointPositionExercise5.csv")
    assert np.isclose(length(squat, "HipLeft", "KneeLeft"), 0.25, atol=0.01)


def test_the_smoothed_copy_is_the_take_smoothed(captures: Path) -> None:
    folder = captures / "kinect2_kimore"
    raw = recognise.read(folder / "JointPositionExercise5.csv")
    smooth = recognise.read(folder / "JointPositionExercise5Filtered.csv")
    assert len(smooth.times) == len(raw.times)
    assert np.nanmedian(np.abs(smooth.positions - raw.positions)) < 0.02
    accelerations = [np.nanstd(np.diff(clip.positions, n=2, axis=0)) for clip in (smooth, raw)]
    assert accelerations[0] < 0.5 * accelerations[1]
