"""KinectReader CSV: the written walk is reproduced; the published recording has its documented clock."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from samples import labanotation as sample
from samples import source_of
from samples.kimore import SENSOR
from samples.motion import in_sight, kinect_v2_joints, walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK, KINECT_V2_JOINTS

TAKE = sample.files()["joints.csv"].decode()
LEGS = [KINECT_V2_JOINTS.index(name) for name in ("AnkleLeft", "FootLeft", "AnkleRight", "FootRight")]


def read(text: str) -> Clip:
    return recognise.read_source(source_of(text, Path("joints.csv")))


def test_the_written_walk_comes_back() -> None:
    clip = read(TAKE)
    assert clip.provenance["format"].startswith("KinectReader")
    expected = kinect_v2_joints(in_sight(walk(90))) + SENSOR[[2, 0, 1]]
    assert np.abs(clip.positions - expected[:, FROM_SDK]).max() < 1e-5
    assert np.abs(clip.times - clip.times[0] - np.arange(90) / 30).max() < 1e-7
    assert np.isclose(clip.times[0], 3186.7373716)
    assert (clip.states[:, LEGS] == 1).all()
    assert (np.delete(clip.states, LEGS, axis=1) == 2).all()


def test_a_repeated_line_is_dropped_and_counted() -> None:
    lines = TAKE.split("\r\n")
    lines[31:31] = [lines[30], lines[10]]
    clip = read("\r\n".join(lines))
    assert np.array_equal(clip.positions, read(TAKE).positions)
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"], defect["action"]) == ("duplicate_frames", 2, "repaired")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda row: row[:-20], r"line 41: expected 101 numbers"),
        (lambda row: "nan" + row[row.index(",") :], "line 41: expected a time, found a non-finite number"),
        (lambda row: row[:-2] + "7,", "line 41: expected a state of ThumbRight, 0, 1 or 2, found 7"),
        (
            lambda row: re.sub(",[^,]*", ",-5e6", row, count=1),
            "line 41: expected at most 100 m in X of SpineBase",
        ),
    ],
)
def test_damage(change, says: str) -> None:  # type: ignore[no-untyped-def]
    lines = TAKE.split("\r\n")
    lines[40] = change(lines[40])
    with pytest.raises(CaptureError, match=says):
        read("\r\n".join(lines))


def test_a_clock_that_no_sensor_has() -> None:
    # A tenth of the ticks: 3.3 milliseconds a frame.
    rows = [line.split(",", 1) for line in TAKE.strip().split("\r\n")]
    with pytest.raises(CaptureError, match=r"steps of 5 to 500 ms, found a median step of 3.3"):
        read("\n".join(f"{int(tick) // 10},{rest}" for tick, rest in rows))
    # Milliseconds in place of ticks are of another program.
    clip = read("\n".join(f"{int(tick) // 10_000},{rest}" for tick, rest in rows))
    assert clip.provenance["format"] == "joint table"
    assert np.allclose(clip.times - clip.times[0], read(TAKE).times - read(TAKE).times[0], atol=2e-3)


def test_the_published_recording(captures: Path) -> None:
    clip = recognise.read(captures / "kinect2_labanotation" / "joints.csv")
    steps = np.diff(clip.times)
    assert len(clip.times) == 371
    assert np.isclose(steps.min(), 0.0325808)
    assert np.isclose(np.median(steps), 0.0330010, atol=1e-6)
    # Standing behind something: "lower legs often inferred".
    assert (clip.states[:, LEGS] == 1).mean() > 0.5
    assert (clip.states[:, KINECT_V2_JOINTS.index("Neck")] == 2).mean() > 0.9


def test_a_table_of_that_width_with_a_header_is_not_claimed() -> None:
    names = ",".join(f"column {k}" for k in range(101))
    assert read(f"{names}\n{TAKE}").provenance["format"] == "joint table"
