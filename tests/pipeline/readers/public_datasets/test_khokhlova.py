"""Khokhlova's rows: positions and orientations agree bone by bone, in the sample and in the recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from samples import khokhlova as sample
from samples import source_of
from samples.kimore import SENSOR
from samples.motion import in_sight, kinect_v2_joints, walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK, KINECT_V2_JOINTS

TAKE = sample.files()["JointsInfo.txt"].decode()


def read(text: str) -> Clip:
    return recognise.read_source(source_of(text, Path("JointsInfo.txt")))


def bone_products(clip: Clip, *, w_first: bool = False) -> NDArray[np.float64]:
    """(T, bones) cosine between the bone that ends at a joint and +Y of the joint's frame in the world."""
    assert clip.rotations is not None
    world = forward_kinematics(clip.skeleton, np.zeros_like(clip.positions), clip.rotations)[1]
    ends = [
        j
        for j, parent in enumerate(clip.skeleton.parents)
        if parent >= 0 and KINECT_V2_JOINTS[j] not in sample.LEAVES
    ]
    starts = [clip.skeleton.parents[j] for j in ends]
    bones = clip.positions[:, ends] - clip.positions[:, starts]
    bones /= np.linalg.norm(bones, axis=-1, keepdims=True)
    return np.sum(rotate(world[:, ends], np.array([0.0, 1.0, 0.0])) * bones, axis=-1)


def test_the_written_walk_comes_back() -> None:
    clip = read(TAKE)
    expected = kinect_v2_joints(in_sight(walk(90))) + SENSOR[[2, 0, 1]]
    assert clip.provenance["format"].startswith("Khokhlova")
    assert np.abs(clip.positions - expected[:, FROM_SDK]).max() < 1e-5
    assert np.abs(clip.times - 0.1 - np.arange(90) / 30).max() < 0.00051
    assert bone_products(clip).min() > 1 - 1e-8
    counts = {defect["rule"]: defect["count"] for defect in clip.provenance["reading"]["defects"]}
    assert counts == {"zero_frames": sample.EMPTY_LINES, "duplicate_frames": 90}


def test_leaves_have_no_rotation() -> None:
    clip = read(TAKE)
    assert clip.rotations is not None
    there = ~np.isnan(clip.rotations[..., 0])
    assert {KINECT_V2_JOINTS[j] for j in np.flatnonzero(~there.all(axis=0))} == set(sample.LEAVES)
    assert not there[:, [KINECT_V2_JOINTS.index(leaf) for leaf in sample.LEAVES]].any()


def test_complete_lines_of_zeros_are_empty_frames() -> None:
    lines = TAKE.strip().split("\n")
    for row in range(20, 24):
        index, time = lines[row].split()[:2]
        lines[row] = f"{index} {time} " + "0 " * 200
    clip = read("\n".join(lines))
    assert len(clip.times) == 88
    assert np.diff(clip.times).max() > 0.09
    assert clip.provenance["reading"]["defects"][0]["count"] == sample.EMPTY_LINES + 4


def change(text: str, line: int, field: int, value: str) -> str:
    lines = text.split("\n")
    fields = lines[line - 1].split()
    fields[field] = value
    lines[line - 1] = " ".join(fields)
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("field", "value", "says"),
    [
        (0, "x", "line 41: expected a number, found 'x'"),
        (1, "inf", "line 41: expected a time, found a non-finite number"),
        (2, "5", "line 41: expected a state of SpineBase, 0, 1 or 2, found 5"),
        (4, "1e6", "line 41: expected at most 100 m in Y of SpineBase"),
        (9, "3", "line 41: expected a unit quaternion of SpineBase"),
        (9, "1e200", "line 41: expected a unit quaternion of SpineBase, found one of length inf"),
    ],
)
def test_damage(field: int, value: str, says: str) -> None:
    with pytest.raises(CaptureError, match=says):
        read(change(TAKE, 41, field, value))


def test_a_recording_without_a_person() -> None:
    empty = "\n".join(TAKE.split("\n")[: sample.EMPTY_LINES])
    with pytest.raises(CaptureError, match="lines of 202 numbers, found none"):
        read(empty)
    with pytest.raises(CaptureError, match="expected a person, found zeros"):
        read("\n".join(f"{k} {33 * k} " + "0 " * 200 for k in range(9)))


def test_the_published_recording(captures: Path) -> None:
    clip = recognise.read(captures / "kinect2_khokhlova_orient" / "JointsInfo_before_CHU_test.txt")
    counts = {defect["rule"]: defect["count"] for defect in clip.provenance["reading"]["defects"]}
    # 1253 lines, 817 whole; of their 816 steps 436 are duplicates.
    assert counts == {"zero_frames": 1253 - 817, "duplicate_frames": 436}
    assert len(clip.times) == 817 - 436
    assert 29 < clip.rate < 33
    products = bone_products(clip)
    assert products.mean(axis=0).min() >= 0.999
    assert products.min() >= 0.999
    thighs = [
        np.linalg.norm(
            clip.positions[:, KINECT_V2_JOINTS.index(f"Hip{side}")]
            - clip.positions[:, KINECT_V2_JOINTS.index(f"Knee{side}")],
            axis=-1,
        )
        for side in ("Left", "Right")
    ]
    assert np.isclose(np.median(thighs), 0.44, atol=0.01)


def test_the_other_sequence_of_the_parts_is_refuted(captures: Path) -> None:
    # The author's other README says w, x, y, z. Read so, bones point against the frames.
    path = captures / "kinect2_khokhlova_orient" / "JointsInfo_before_CHU_test.txt"
    lines = [line.split() for line in path.read_text().split("\n")]
    for row in lines:
        if len(row) == 202:
            for joint in range(25):
                k = 2 + 8 * joint + 4
                row[k : k + 4] = [row[k + 1], row[k + 2], row[k + 3], row[k]]
    products = bone_products(read("\n".join(" ".join(row) for row in lines)))
    limbs = [name for name in KINECT_V2_JOINTS if name not in (*sample.LEAVES, "SpineBase")]
    means = dict(zip(limbs, products.mean(axis=0), strict=True))
    assert all(means[name] < -0.9 for name in ("SpineMid", "Neck", "KneeLeft", "AnkleLeft"))
    assert all(value < 0.3 for value in means.values())
