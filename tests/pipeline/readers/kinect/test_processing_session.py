"""Processing sessions: columns by name, w first, the frame count as clock."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import processing_session as sample
from samples import source_of
from samples.kimore import SENSOR
from samples.motion import in_sight, kinect_v2_joints, walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK, KINECT_V2_JOINTS

TAKE = sample.files()["skeleton1.txt"].decode()
LINES = TAKE.strip().split("\n")


def read(text: str) -> Clip:
    return recognise.read_source(source_of(text, Path("skeleton1.txt")))


def bone_product(clip: Clip, joint: str) -> float:
    """Mean cosine between the bone that ends at the joint and +Y of its frame."""
    assert clip.rotations is not None
    world = forward_kinematics(clip.skeleton, np.zeros_like(clip.positions), clip.rotations)[1]
    end = clip.skeleton.index(joint)
    bone = clip.positions[:, end] - clip.positions[:, clip.skeleton.parents[end]]
    bone /= np.linalg.norm(bone, axis=-1, keepdims=True)
    return float(np.mean(np.sum(rotate(world[:, end], np.array([0.0, 1.0, 0.0])) * bone, axis=-1)))


def test_the_written_walk_comes_back() -> None:
    clip = read(TAKE)
    expected = kinect_v2_joints(in_sight(walk(90))) + SENSOR[[2, 0, 1]]
    assert clip.provenance["format"] == "Processing session"
    assert np.abs(clip.positions - expected[:, FROM_SDK]).max() < 1e-6
    assert min(bone_product(clip, joint) for joint in ("KneeLeft", "ElbowRight", "Neck")) > 1 - 1e-8
    # The sketch skipped a frame behind the 45th.
    steps = np.round(np.diff(clip.times) * 30).astype(int)
    assert np.flatnonzero(steps != 1).tolist() == [45]
    assert steps[45] == 2


def test_columns_are_found_by_name() -> None:
    swapped = [" ".join(reversed(line.split())) for line in LINES]
    assert np.array_equal(read("\n".join(swapped)).positions, read(TAKE).positions)


def test_short_rows_are_left_out_and_noted() -> None:
    lines = [*LINES[:30], LINES[30][:200], LINES[31] + " 4", *LINES[32:]]
    clip = read("\n".join(lines))
    assert len(clip.times) == 88
    assert any(note.startswith("2 lines with more or fewer") for note in clip.provenance["reading"]["notes"])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (LINES[0], "line 2: expected lines of numbers, found none"),
        (TAKE.replace("joint7OrientationY", "joint7OrientationQ", 1), "found no column joint7OrientationY"),
        (TAKE.replace("joint7OrientationY", "joint7OrientationZ", 1), "'joint7OrientationZ' twice"),
        ("\n".join([*LINES[:5], LINES[5].replace(" 1.5 ", " oops ", 1)]), "line 6: expected a number"),
        ("\n".join([*LINES[:5], "nan" + LINES[5][2:]]), "line 6: expected a time"),
        ("\n".join([LINES[0], "1 2 3"]), r"lines of 179 numbers, found none of that length"),
    ],
)
def test_damage(text: str, says: str) -> None:
    with pytest.raises(CaptureError, match=says):
        read(text)


def test_without_its_header_it_is_a_candidate() -> None:
    row = " ".join(["1"] * 188)
    with pytest.raises(CaptureError, match=r"a table of 188 numbers.*Processing session"):
        read("\n".join([row] * 20))


def test_the_published_session(captures: Path) -> None:
    clip = recognise.read(captures / "kinect2_processing_session" / "skeleton1.txt")
    assert len(clip.times) == 238
    assert np.allclose(np.diff(clip.times), 1 / 30)
    for side in ("Left", "Right"):
        hip, knee, ankle = (
            clip.positions[:, KINECT_V2_JOINTS.index(f"{j}{side}")] for j in ("Hip", "Knee", "Ankle")
        )
        assert np.isclose(np.median(np.linalg.norm(knee - hip, axis=-1)), 0.37, atol=0.005)
        assert np.isclose(np.median(np.linalg.norm(ankle - knee, axis=-1)), 0.375, atol=0.005)
    # One of the two is smoothed: close at trunk and legs, and the sequence w first is beyond doubt.
    for joint in ("SpineMid", "SpineShoulder", "Neck", "KneeLeft", "KneeRight", "AnkleLeft", "AnkleRight"):
        assert bone_product(clip, joint) > 0.995
