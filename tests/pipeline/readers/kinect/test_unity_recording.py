"""Recordings of the Unity assets for Kinect v2 and Azure Kinect, written here from a known walk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import source_of
from samples import unity_recording as sample
from samples.motion import kinect_v2_joints, walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.kinect import unity_recording
from kinemimic.pipeline.readers.kinect.azure_joints import AZURE_JOINTS
from kinemimic.pipeline.readers.kinect.kinect_v2 import SDK_JOINTS

FRAMES = 60
KINECT, AZURE = (content.decode() for content in sample.files(FRAMES).values())


def read(text: str) -> Clip:
    return recognise.read_source(source_of(text, Path("BodyRecording.txt")))


@pytest.mark.parametrize("text", [KINECT, AZURE, AZURE.replace(",", ";"), KINECT.replace(",", ";")])
def test_the_walk_is_read(text: str) -> None:
    clip = read(text)
    shown = walk(FRAMES)
    assert clip.provenance["format"] == unity_recording.FORMAT.name
    found = leg_angles(to_nodes(clip)[0], times=clip.times)
    for side, truth in leg_angles(shown.joints, times=shown.times).items():
        assert np.degrees(np.abs(found[side] - truth).max()) < 1.0  # places are rounded to the millimetre
    assert np.abs(np.diff(clip.times) - 1 / 30).max() < 1e-6


def test_decimal_commas_between_semicolons() -> None:
    other = KINECT.replace(",", ";").replace(".", ",")
    assert np.array_equal(read(other).positions, read(KINECT).positions, equal_nan=True)


@pytest.mark.parametrize(("text", "joints"), [(KINECT, SDK_JOINTS), (AZURE, sample.UNITY_AZURE_JOINTS)])
def test_a_joint_without_a_place_shortens_the_line(text: str, joints: tuple[str, ...]) -> None:
    clip = read(text)
    names = clip.skeleton.names
    lost, inferred = names.index(joints[sample.LOST]), names.index(joints[sample.INFERRED])
    assert clip.states[sample.FRAME, [lost, inferred]].tolist() == [0, 1]
    assert np.isnan(clip.positions[sample.FRAME, lost]).all()
    clip.states[sample.FRAME, [lost, inferred]] = 2
    assert (clip.states == 2).all()


def test_the_azure_assets_order_has_every_joint() -> None:
    assert sorted(sample.UNITY_AZURE_JOINTS) == sorted(AZURE_JOINTS)


def test_the_person_in_most_frames_is_read() -> None:
    (defect,) = read(AZURE).provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"]) == ("several_people", 1)
    assert f"1 more in {FRAMES // 3} frames, dropped; body {sample.PERSON}" in defect["text"]


def test_frames_of_nobody_are_missing() -> None:
    lines = KINECT.splitlines()
    lines[5] = ",".join([*lines[5].split(",")[:4], *"000000"])
    clip = read("\n".join(lines))
    assert np.flatnonzero((clip.states == 0).all(axis=1)).tolist() == [5]


def test_a_kinect_v1_has_twenty_joints() -> None:
    places = kinect_v2_joints(walk(FRAMES))[:, :20]
    bodies = [sample.body(1, frame, states={}, angles=False) for frame in places]
    lines = [
        sample.line(time, "kb", 20, [], [body]) for time, body in zip(walk(FRAMES).times, bodies, strict=True)
    ]
    assert read("\n".join(lines)).positions.shape == (FRAMES, 20, 3)


def test_the_unit_of_the_sensors_clock_is_told_by_the_game() -> None:
    lines = [line.split(",") for line in KINECT.splitlines()]
    for cells in lines:
        cells[1] = str(int(cells[1]) // 10000)
    milliseconds = read("\n".join(",".join(cells) for cells in lines))
    assert np.abs(milliseconds.times - read(KINECT).times).max() < 1.1e-3
    for number, cells in enumerate(lines):
        cells[1] = str(number)
    clip = read("\n".join(",".join(cells) for cells in lines))
    assert "times are the game's" in " ".join(clip.provenance["reading"]["notes"])
    assert clip.times[-1] - clip.times[0] == pytest.approx((FRAMES - 1) / 30, abs=0.02)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            ",6,25,",
            ",6,24,",
            "expected 20 or 25 joints of kb, or 32 of k4b, as many in every line, found kb with 24",
        ),
        (",6,25,", ",2,25,", "expected the cells of 2 bodies of 25 joints, found too many"),
        (",6,25,", ",7,25,", "expected the cells of 7 bodies of 25 joints, found too few"),
        (",6,25,", ",6,25,x,", "expected numbers, found 'x'"),
        ("|kb", "|kc", "expected a time"),
    ],
)
def test_a_damaged_line_is_named(old: str, new: str, message: str) -> None:
    lines = KINECT.splitlines()
    lines[3] = lines[3].replace(old, new, 1)
    with pytest.raises(CaptureError, match="line 4: .*" + message.replace("|", r"\|")):
        read("\n".join(lines))


def test_a_recording_of_nobody_is_refused() -> None:
    lines = [sample.line(time, "kb", 25, [], [["0"]] * 6) for time in walk(FRAMES).times]
    with pytest.raises(CaptureError, match="expected a person, found none"):
        read("\n".join(lines))


def test_a_clock_beyond_any_float() -> None:
    lines = [line.split(",") for line in KINECT.splitlines()]
    lines[0][1], lines[-1][1] = "1e308", "-1e308"
    clip = read("\n".join(",".join(cells) for cells in lines))
    assert "times are the game's" in " ".join(clip.provenance["reading"]["notes"])
