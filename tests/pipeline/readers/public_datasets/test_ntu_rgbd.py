"""NTU RGB+D's `.skeleton` files: the person comes back, with orientations; things beside them are dropped."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import ntu_rgbd as sample
from samples import source_of
from samples.kimore import SENSOR
from samples.motion import in_sight, kinect_v2_joints, walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK, KINECT_V2_JOINTS

NAME = "S001C001P001R001A059.skeleton"
TAKE = sample.files()[NAME].decode()
FRAMES = 90 + sample.EMPTY_FRAMES


def read(text: str) -> Clip:
    return recognise.read_source(source_of(text, Path(NAME)))


def changed(line: int, new: str | None) -> str:
    lines = TAKE.split("\r\n")
    lines[line - 1 : line] = [] if new is None else [new]
    return "\n".join(lines)


def test_the_written_walk_comes_back() -> None:
    clip = read(TAKE)
    expected = kinect_v2_joints(in_sight(walk(90))) + SENSOR[[2, 0, 1]]
    assert clip.provenance["format"].startswith("NTU RGB+D")
    assert np.allclose(clip.times, np.arange(FRAMES) / 30)
    assert (clip.states[: sample.EMPTY_FRAMES] == MISSING).all()
    assert np.abs(clip.positions[sample.EMPTY_FRAMES :] - expected[:, FROM_SDK]).max() < 1e-5
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"], defect["action"]) == ("several_people", 1, "repaired")


def test_orientations_agree_with_the_bones() -> None:
    clip = read(TAKE)
    assert clip.rotations is not None
    seen = slice(sample.EMPTY_FRAMES, None)
    rotations = clip.rotations[seen]
    world = forward_kinematics(clip.skeleton, np.zeros_like(clip.positions[seen]), rotations)[1]
    knee, hip = (KINECT_V2_JOINTS.index(name) for name in ("KneeLeft", "HipLeft"))
    bone = clip.positions[seen, knee] - clip.positions[seen, hip]
    bone /= np.linalg.norm(bone, axis=-1, keepdims=True)
    assert np.sum(rotate(world[:, knee], np.array([0.0, 1.0, 0.0])) * bone, axis=-1).min() > 1 - 1e-6


def test_of_two_bodies_seen_equally_often_the_better_tracked_one() -> None:
    lines = TAKE.split("\r\n")
    # Two frames of nobody, and the first two of the person alone, are left out.
    body = 2 + 25
    lines = [f"{90 - sample.EMPTY_FRAMES}", *lines[1 + sample.EMPTY_FRAMES + 2 * (1 + body) :]]
    clip = read("\n".join(lines))
    assert len(clip.times) == 88
    assert not (clip.states == INFERRED).any()


@pytest.mark.parametrize(
    ("line", "new", "says"),
    [
        (1, "91", "line 4845: expected the end of the file after its frames, found '2'"),
        (1, "93", "expected a number of bodies, 0 to 6, found the end of the file"),
        (4, "7", "line 4: expected a number of bodies, 0 to 6, found '7'"),
        (34, "24", "line 34: expected a number of joints, 25, found '24'"),
        (8, "0 0 2", "line 8: expected 12 numbers of SpineMid, found 3 words"),
        (8, " ".join(["x"] * 12), "line 8: expected 12 numbers of SpineMid, found 12 words"),
        (8, "0 0 2 0 0 0 0 1 0 0 0 3", "body of line 5: expected a state of SpineMid, 0, 1 or 2, found 3"),
        (8, "0 0 900 0 0 0 0 1 0 0 0 2", "body of line 5: expected at most 100 m in Z of SpineMid"),
        (8, "0 0 2 0 0 0 0 1 1 0 0 2", "body of line 5: expected a unit quaternion of SpineMid"),
    ],
)
def test_damage(line: int, new: str, says: str) -> None:
    with pytest.raises(CaptureError, match=says):
        read(changed(line, new))


def test_a_recording_without_a_person() -> None:
    with pytest.raises(CaptureError, match="expected a person, found 9 frames without one"):
        read("\n".join(["9", *["0"] * 9]))
