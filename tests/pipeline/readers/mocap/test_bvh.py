"""The BVH reader: kinematics compared with matrices, channels, calibration poses, real libraries."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import bvh as samples_bvh
from samples import source_of

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.rotations import from_euler, to_matrix
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap import bvh as reader

Text = Callable[..., str]
PATH = Path("walk.bvh")


def turn(axis: str, degrees: float) -> Array:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return {
        "X": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "Y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "Z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[axis]


def test_kinematics_by_hand(bvh: Text) -> None:
    motion = np.zeros((3, 37))
    motion[:, 1] = [95, 96, 97]
    motion[1, 3:6] = [10, 20, 30]  # root Z Y X
    motion[1, 27:30] = [-40, 50, 60]  # left thigh Z X Y
    motion[1, 30:33] = [70, -15, 25]  # left knee X Y Z
    clip = reader.read(source_of(bvh(motion=motion), PATH))
    root = turn("Z", 10) @ turn("Y", 20) @ turn("X", 30)
    thigh = root @ turn("Z", -40) @ turn("X", 50) @ turn("Y", 60)
    shank = thigh @ turn("X", 70) @ turn("Y", -15) @ turn("Z", 25)
    hip = np.array([0, 96, 0]) + root @ [9, -8, 0]
    knee = hip + thigh @ [0, -43, 0]
    ankle = knee + shank @ [0, -40, 0]
    toe = ankle + shank @ [0, -4, 12]
    for name, place in {"LeftUpLeg": hip, "LeftLeg": knee, "LeftFoot": ankle, "LeftFoot_end": toe}.items():
        x, y, z = 0.01 * place
        assert clip.positions[1, clip.skeleton.index(name)] == pytest.approx([z, x, y], abs=1e-9), name


def test_orders_channels_and_clock(bvh: Text) -> None:
    clip = reader.read(source_of(bvh(), PATH))
    orders = dict(zip(clip.skeleton.names, clip.orders or (), strict=True))
    assert orders["Hips"] == "ZYX"
    assert orders["LeftForeArm"] == "YZX"
    assert orders["RightLeg"] == "XYZ"  # one channel; the axes that it lacks stay zero
    assert orders["LeftHand"] == orders["Head_end"] == ""
    assert clip.euler is not None
    assert not clip.euler[:, clip.skeleton.index("RightLeg"), 1:].any()
    assert np.allclose(clip.times, np.arange(40) * 0.0333333)
    assert clip.provenance["reading"]["units"] == "cm"


@pytest.mark.parametrize("order", ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"])
def test_any_order_of_three_channels(bvh: Text, order: str) -> None:
    names = " ".join(f"{axis}rotation" for axis in order)
    text = bvh().replace(
        "LeftUpLeg { OFFSET 9 -8 0 CHANNELS 3 Zrotation Xrotation Yrotation",
        "LeftUpLeg { OFFSET 9 -8 0 CHANNELS 3 " + names,
    )
    clip = reader.read(source_of(text, PATH))
    joint = clip.skeleton.index("LeftUpLeg")
    assert clip.euler is not None and clip.orders is not None
    assert clip.orders[joint] == order
    q = from_euler(clip.euler[0, joint], order)
    product = np.linalg.multi_dot(
        [turn(a, np.degrees(v)) for a, v in zip(order, clip.euler[0, joint], strict=True)]
    )
    assert np.allclose(to_matrix(q), product, atol=1e-12)


def z_up(text: str) -> str:
    """The same skeleton and motion in axes of which Z is up: Z becomes X, X becomes Y, Y becomes Z."""
    head, _, motion = text.partition("MOTION")
    head = re.sub(r"OFFSET\s+(\S+)\s+(\S+)\s+(\S+)", r"OFFSET \3 \1 \2", head)
    head = re.sub("[XYZ](?=position|rotation)", lambda axis: {"X": "Y", "Y": "Z", "Z": "X"}[axis[0]], head)
    return f"{head}MOTION{motion}"


def test_a_skeleton_that_stands_along_z() -> None:
    """As Blender exports it. Somebody who lies, or whose root stands the skeleton up, has Y up."""
    text = samples_bvh.files(40)["walk.bvh"].decode()
    usual, turned = (reader.read(source_of(one, PATH)) for one in (text, z_up(text)))
    np.testing.assert_allclose(turned.positions, usual.positions, atol=1e-12)
    assert "Z is up" in turned.provenance["reading"]["notes"][0]
    for lying, root in ((text, ["0", "90", "0"]), (z_up(text), ["-90", "0", "0"])):
        head, step, motion = lying.partition("Frame Time: 0.00833333\n")
        rows = [row.split() for row in motion.splitlines()]
        rows = [[*row[:3], *root, *row[6:]] for row in rows]
        clip = reader.read(source_of(head + step + "\n".join(map(" ".join, rows)), PATH))
        assert not clip.provenance["reading"]["notes"]


def test_position_channels_replace_the_offset(bvh: Text) -> None:
    six = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
    text = bvh().replace(
        "LeftUpLeg { OFFSET 9 -8 0 CHANNELS 3 Zrotation Xrotation Yrotation",
        f"LeftUpLeg {{ OFFSET 9 -8 0 {six}",
    )
    head, rows = text.split("0.0333333\n")
    lines = [row.split() for row in rows.strip().split("\n")]
    longer = [" ".join([*row[:27], "11", "-7", "1", *row[27:]]) for row in lines]
    clip = reader.read(source_of(head + "0.0333333\n" + "\n".join(longer), PATH))
    hips, thigh = (clip.positions[:, clip.skeleton.index(name)] for name in ("Hips", "LeftUpLeg"))
    assert np.linalg.norm(thigh - hips, axis=-1) == pytest.approx(0.01 * np.sqrt(121 + 49 + 1))


def test_position_channels_that_leave_no_bones_are_added_to_the_offset(bvh: Text) -> None:
    """Tools that write six channels for every joint may write zeros for the positions of all but the root."""
    head, _, body = bvh().partition("MOTION\n")
    frames, time, *rows = body.rstrip("\n").split("\n")
    counts = [int(word) for word in re.findall(r"CHANNELS (\d)", head)]
    first, *others = re.split(r"CHANNELS (?=\d)", head)
    six = "CHANNELS 6 Xposition Yposition Zposition "
    parts = [f"{six}{part[2:]}" if part[0] == "3" else f"CHANNELS {part}" for part in others]
    wider = []
    for row in rows:
        words, numbers = [], row.split()
        for count in counts:
            words += (["0.001", "0", "0"] if count == 3 else []) + numbers[:count]
            numbers = numbers[count:]
        wider.append(" ".join(words))
    text = "\n".join([f"{first}{''.join(parts)}MOTION", frames, time, *wider])
    clip = reader.read(source_of(text, PATH))
    assert np.abs(clip.positions - reader.read(source_of(bvh(), PATH)).positions).max() < 1e-3
    assert "added to the offsets" in clip.provenance["reading"]["notes"][0]


def test_scale_channels_are_not_applied(bvh: Text) -> None:
    plain = bvh()
    scaled = plain.replace(
        "CHANNELS 6 Xposition Yposition Zposition",
        "CHANNELS 9 Xscale Yscale Zscale Xposition Yposition Zposition",
    )
    head, rows = scaled.split("0.0333333\n")
    longer = "".join(f"1 1 1 {row}\n" for row in rows.splitlines())
    clip = reader.read(source_of(f"{head}0.0333333\n{longer}", PATH))
    assert np.array_equal(clip.positions, reader.read(source_of(plain, PATH)).positions)
    assert clip.provenance["reading"]["notes"] == ["the file has scale channels, which are not applied"]


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t.lower().replace("hips", "Hips"),
        lambda t: t.replace(" ", "\t").replace("Frame\tTime", "Frame Time").replace("End\tSite", "End Site"),
        lambda t: t.replace("Frames: 40", "Frames:\t40").replace("\n", "\n\n"),
        lambda t: t.replace("OFFSET 0 -43 0", "OFFSET 0.0e0 -4.3E+1 0"),
        lambda t: t.rstrip("\n"),
        lambda t: t.replace("Frame Time: ", "FrameTime:").replace("Frames: ", "Frames "),
        lambda t: t.replace("{", "\n{\n").replace("}", "\n}\n"),
    ],
)
def test_spelling_does_not_matter(bvh: Text, change: Callable[[str], str]) -> None:
    assert np.array_equal(
        reader.read(source_of(change(bvh()), PATH)).positions,
        reader.read(source_of(bvh(), PATH)).positions,
    )


def test_a_doubtful_unit_is_in_the_report(bvh: Text) -> None:
    child = bvh().replace("OFFSET 0 -43 0", "OFFSET 0 -23 0").replace("OFFSET 0 -40 0", "OFFSET 0 -21 0")
    reading = reader.read(source_of(child, PATH)).provenance["reading"]
    assert reading["units"] == "cm"
    (defect,) = reading["defects"]
    assert (defect["rule"], defect["action"]) == ("wrong_units", "flagged")


def t_pose_before(frames: int, leading: int) -> Array:
    motion = 20.0 * np.sin(0.05 * np.arange(frames)[:, None] + 1.7 * np.arange(37))
    motion[:leading] = 0.0
    motion[:leading, 30] = -21.0
    return motion


@pytest.mark.parametrize("leading", [1, 2])
def test_a_calibration_pose_is_dropped_and_reported(bvh: Text, leading: int) -> None:
    clip = reader.read(source_of(bvh(motion=t_pose_before(60, leading)), PATH))
    assert len(clip.times) == 60 - leading
    assert clip.times[0] == pytest.approx(leading * 0.0333333)
    reading = clip.provenance["reading"]
    (defect,) = reading["defects"]
    assert (defect["rule"], defect["action"], defect["count"]) == ("calibration_frames", "repaired", leading)
    assert "calibration pose" in defect["text"]


def test_a_motion_in_whole_degrees_or_starting_at_rest_keeps_its_first_frame(bvh: Text) -> None:
    for motion in (np.round(t_pose_before(60, 0)), t_pose_before(60, 0) * np.linspace(0, 1, 60)[:, None]):
        clip = reader.read(source_of(bvh(motion=motion), PATH))
        assert len(clip.times) == 60
        assert clip.provenance["reading"]["defects"] == []


def test_a_leaf_without_an_end_site(bvh: Text) -> None:
    clip = reader.read(source_of(bvh().replace("End Site { OFFSET 0 -4 12 }", ""), PATH))
    assert "LeftFoot_end" not in clip.skeleton.names


def test_no_motion_at_all(bvh: Text, captures: Path) -> None:
    with pytest.raises(CaptureError, match="every channel is zero in all 30 frames; no motion was recorded"):
        reader.read(source_of(bvh(motion=np.zeros((30, 37))), PATH))
    with pytest.raises(CaptureError, match="every channel is zero in all 219 frames"):
        reader.read(Source.open(captures / "kinect2_kinect2bvh" / "test.bvh"))
    with pytest.raises(CaptureError, match=r"line 5: .*found 'ROT'"):
        reader.read(Source.open(captures / "kinect2_kinect2bvh" / "Girl_Blendswap5_AddRoot3.bvh"))


def test_repeated_names_are_made_unique(bvh: Text) -> None:
    text = bvh().replace("OFFSET 0 -4 12 }", "OFFSET 0 -4 12 } End Site { OFFSET 0 -4 9 }", 1)
    names = reader.read(source_of(text, PATH)).skeleton.names
    assert {"LeftFoot_end", "LeftFoot_end_2"} <= set(names)


def test_cmu_drops_its_t_pose(captures: Path) -> None:
    for path in sorted((captures / "cmu_bvh").glob("*.bvh")):
        clip = reader.read(Source.open(path))
        # 07_12 was recorded with a second such pose, all zero.
        assert [d["count"] for d in clip.provenance["reading"]["defects"]] == [
            2 if path.stem == "07_12" else 1
        ]
        assert clip.provenance["reading"]["units"].startswith("CMU")
        knee, ankle = (clip.skeleton.index(f"Left{joint}") for joint in ("Leg", "Foot"))
        shank = np.linalg.norm(clip.positions[:, ankle] - clip.positions[:, knee], axis=-1)
        assert 0.40 < shank.mean() < 0.44
        assert np.ptp(shank) < 1e-9


def test_position_channels_of_kinect_exporters_replace_offsets(captures: Path) -> None:
    path = captures / "kinect2_brekel_bvh" / "motion1_v.bvh"
    clip = reader.read(Source.open(path))
    hip, knee = (clip.positions[:, clip.skeleton.index(name)] for name in ("LeftUpLeg", "LeftLeg"))
    assert np.linalg.norm(knee - hip, axis=-1).mean() == pytest.approx(0.315, abs=0.01)


@pytest.mark.parametrize("folder", ["shum_gait_bvh", "bandai_bvh_ccbync"])
def test_other_real_libraries(captures: Path, folder: str) -> None:
    for path in sorted((captures / folder).glob("*.bvh")):
        clip = reader.read(Source.open(path))
        assert clip.provenance["reading"]["units"] == "cm"
        assert clip.provenance["reading"]["defects"] == []
        height = np.median(np.ptp(clip.positions[..., 2], axis=1))
        assert 1.2 < height < 1.9
