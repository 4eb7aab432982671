"""Joint arrays: the known walk in every joint set, and what is no body in any of them."""

from __future__ import annotations

import hashlib
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from samples.joint_array import archive, files, joints, saved
from samples.matlab_markers import saved as mat_file
from samples.motion import Walk, walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.landmarks.blaze_pose import LANDMARKS
from kinemimic.pipeline.readers.landmarks.joint_sets import (
    AZURE_KINECT,
    COUNTS,
    KINECT_V1,
    KINECT_V2,
    MEDIAPIPE,
    SETS,
    JointSet,
    joint_set_of,
)

HUMAN36M, COCO = SETS[:2]


def read(content: bytes, name: str = "joints.npy") -> Clip:
    return recognise.read_source(Source(Path(name), content, hashlib.sha256(content).hexdigest()))


def truth(shown: Walk, clip: Clip) -> np.ndarray:
    return np.stack([shown.joints[:, NODE_INDEX[name]] for name in clip.skeleton.names], axis=1)


@pytest.mark.parametrize("joint_set", SETS, ids=lambda joint_set: joint_set.name)
@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_every_set_is_told_by_the_body_that_it_makes(joint_set: JointSet, unit: float) -> None:
    shown = walk(60)
    clip = read(saved(unit * joints(shown, joint_set)))
    assert clip.provenance["format"] == "joint array"
    assert clip.provenance["reading"]["units"] == ("m" if unit == 1.0 else "mm")
    assert clip.provenance["reading"]["notes"][0].startswith(joint_set.name)
    assert clip.rate == pytest.approx(joint_set.rate)
    assert set(clip.skeleton.names) == joint_set.nodes.keys()
    np.testing.assert_allclose(clip.positions, truth(shown, clip), atol=1e-6)


@pytest.mark.parametrize("unused", [(), (0,), (1,)])
def test_an_axis_of_one_person_and_other_arrays_of_an_archive(unused: tuple[int, ...]) -> None:
    points = joints(walk(30), COCO)
    expected = read(saved(points)).positions
    packed = archive(reconstruction=np.expand_dims(points, unused), scores=np.ones((30, 17)))
    np.testing.assert_array_equal(read(packed, "joints.npz").positions, expected)


@pytest.mark.parametrize(
    ("other", "rate"),
    [
        ({"fps": 60}, 60.0),
        ({"frame_rate": np.array([120.0])}, 120.0),
        ({"fps": "60"}, 60.0),
        ({"timestamps": 5.0 + np.arange(30) / 50.0}, 50.0),
        ({"times": np.arange(30)[:, None] * 20_000}, 50.0),
        ({"frame_ids": 3 * np.arange(30)}, 10.0),
        ({"scores": np.linspace(0.0, 1.0, 30), "times": np.zeros(12)}, 30.0),
    ],
)
def test_the_clock_or_rate_of_an_archive(other: dict[str, object], rate: float) -> None:
    points = joints(walk(30), COCO)
    clip = read(archive(joints=points, **other), "joints.npz")
    assert clip.rate == pytest.approx(rate)
    assert len(clip.times) == 30


def test_a_rate_that_is_none_is_refused() -> None:
    with pytest.raises(CaptureError, match="expected 1 to 1000 frames per second in fps, found 0"):
        read(archive(joints=joints(walk(30), COCO), fps=0), "joints.npz")


def test_rate_wins_over_the_clock_of_an_archive(tmp_path: Path) -> None:
    path = tmp_path / "joints.npz"
    path.write_bytes(archive(joints=joints(walk(30), COCO), fps=60))
    assert recognise.read(path, rate=25.0).rate == pytest.approx(25.0)


@pytest.mark.parametrize("in_a_row", [False, True])
@pytest.mark.parametrize("fields", [3, 4])
def test_landmarks_in_a_row_and_with_their_visibility(fields: int, in_a_row: bool) -> None:
    shown = walk(30)
    visibility = np.full((30, 33, 1), 0.9)
    visibility[10:, LANDMARKS.index("left_knee")] = 0.2
    points = np.concatenate([joints(shown, MEDIAPIPE), visibility], axis=-1)[..., :fields]
    clip = read(saved(points.reshape(30, -1) if in_a_row else points))
    np.testing.assert_allclose(clip.positions, truth(shown, clip), atol=1e-6)
    knee = clip.states[:, clip.skeleton.names.index("knee_left")]
    assert knee.tolist() == ([2] * 30 if fields == 3 else [2] * 10 + [1] * 20)


@pytest.mark.parametrize("joint_set", [KINECT_V1, KINECT_V2, AZURE_KINECT], ids=lambda one: one.name)
@pytest.mark.parametrize("layout", ["in a row", "behind the axes", "with a state", "with a state, in a row"])
def test_the_arrays_of_other_programs(layout: str, joint_set: JointSet) -> None:
    shown = walk(30)
    points = joints(shown, joint_set)
    knee = joint_set.nodes["knee_left"][0]
    if "state" in layout:
        states = np.full((30, points.shape[1], 1), 2.0)
        states[10:, knee] = 1.0
        points = np.concatenate([points, states], axis=-1)
    if "row" in layout:
        points = points.reshape(30, -1)
    clip = read(saved(np.swapaxes(points, 1, 2) if layout == "behind the axes" else points))
    np.testing.assert_allclose(clip.positions, truth(shown, clip), atol=1e-6)
    seen = clip.states[:, clip.skeleton.names.index("knee_left")].tolist()
    assert seen == ([2] * 10 + [1] * 20 if "state" in layout else [2] * 30)


@pytest.mark.parametrize("joint_set", SETS, ids=lambda one: one.name)
@pytest.mark.parametrize("axes", list(permutations(range(3))))
def test_a_mat_file_has_its_axes_in_any_order(axes: tuple[int, int, int], joint_set: JointSet) -> None:
    shown = walk(60)
    content = mat_file(d_skel=np.transpose(joints(shown, joint_set), axes), action="walk")
    clip = read(content, "joints.mat")
    assert clip.provenance["reading"]["notes"][0].startswith(joint_set.name)
    np.testing.assert_allclose(clip.positions, truth(shown, clip), atol=1e-6)


def test_shapes_of_a_body_model_beside_the_joints_of_an_archive() -> None:
    points = joints(walk(80), KINECT_V1)
    expected = read(saved(points)).positions
    for other in ((20, 3, 3), (20, 3, 10), (80, 3, 3)):
        packed = archive(joints=points, other=np.ones(other))
        np.testing.assert_array_equal(read(packed, "joints.npz").positions, expected)


@pytest.mark.parametrize("count", [60, 66, 75, 80, 90, 100])
@pytest.mark.parametrize("frames_last", [False, True])
def test_rows_of_a_mat_file_of_any_number_of_frames(frames_last: bool, count: int) -> None:
    shown = walk(count)
    rows = joints(shown, KINECT_V1).reshape(count, -1)
    content = mat_file(j=rows.T if frames_last else rows, com=np.ones((count, 3)))
    clip = read(content, "joints.mat")
    np.testing.assert_allclose(clip.positions, truth(shown, clip), atol=1e-6)


def test_a_pelvis_at_the_origin_of_a_camera_is_none() -> None:
    points = joints(walk(60), KINECT_V1) + np.array([0.0, -2.4, 3.0])
    points[:, 0] = 0.0
    clip = read(saved(points))
    assert "hip_center" not in clip.skeleton.names
    assert clip.provenance["reading"]["notes"][0].startswith("Kinect v1")


@pytest.mark.parametrize("frames_last", [False, True])
def test_a_mat_file_of_rows_with_its_clock(frames_last: bool) -> None:
    shown = walk(50)
    rows = joints(shown, KINECT_V2).reshape(50, -1)
    clip = read(mat_file(skeleton=rows.T if frames_last else rows, SamplingRate=60.0), "joints.mat")
    np.testing.assert_allclose(clip.positions, truth(shown, clip), atol=1e-6)
    assert clip.rate == pytest.approx(60.0)
    timed = mat_file(skeleton=rows, times=np.arange(50) / 20.0)
    assert read(timed, "joints.mat").rate == pytest.approx(20.0)


def test_rotations_beside_the_joints_of_an_archive() -> None:
    points = joints(walk(30), KINECT_V1)
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (30, 20, 1))
    clip = read(archive(joints=points, rotations=turns), "joints.npz")
    np.testing.assert_allclose(clip.positions, truth(walk(30), clip), atol=1e-6)


def test_joints_about_the_pelvis_have_no_pelvis() -> None:
    shown = walk(60)
    clip = read(files(60)["joints.npy"])
    assert "hip_center" not in clip.skeleton.names
    hips = shown.joints[:, [NODE_INDEX["hip_center"]]]
    np.testing.assert_allclose(clip.positions, truth(shown, clip) - hips, atol=1e-6)


def test_other_axes_are_turned_upright() -> None:
    """The usual axes are only a first guess: a generator may have Z up."""
    points = rotate(COCO.world_from_file, joints(walk(120), COCO))
    clip = check_capture(read(saved(points))).clip
    head, ankle = (clip.positions[:, clip.skeleton.names.index(name), 2] for name in ("head", "ankle_left"))
    assert (head > ankle + 1.0).all()


def test_joints_that_are_not_seen_are_missing() -> None:
    points = joints(walk(30), HUMAN36M)
    wrist = HUMAN36M.joints.index("left_wrist")
    points[10:20, wrist] = np.nan
    clip = read(saved(points))
    column = clip.skeleton.names.index("wrist_left")
    np.testing.assert_array_equal(np.isnan(clip.positions[..., 0]).nonzero()[0], np.arange(10, 20))
    assert not clip.states[10:20, column].any()


def test_no_body_in_any_order_is_refused() -> None:
    points = joints(walk(60), HUMAN36M)
    assert joint_set_of(points) is HUMAN36M
    with pytest.raises(CaptureError, match="found limbs that change their lengths"):
        read(saved(points[:, ::-1]))


@pytest.mark.parametrize("count", sorted(COUNTS))
def test_still_points_are_no_body(count: int) -> None:
    """Numbers that hardly change keep all lengths; of one in six the sides are alike by chance."""
    taken = 0
    for seed in range(40):
        random = np.random.default_rng(seed)
        points = random.normal(size=(1, count, 3)) + 0.01 * random.normal(size=(20, count, 3))
        taken += joint_set_of(points) is not None
    assert taken <= 1


def test_a_body_in_the_corner_of_a_room_is_no_picture() -> None:
    """On a treadmill, no coordinate of it is negative, and none of the third above 1."""
    points = joints(walk(40), KINECT_V2)
    points = points - points[:, :1]
    points -= points.min(axis=(0, 1))
    assert points[..., 1].max() > 1.0 > points[..., 2].max()
    assert len(read(saved(points)).times) == 40


@pytest.mark.parametrize("size", [1.0, 1000.0])
def test_keypoints_in_a_picture_are_refused(size: float) -> None:
    places = joints(walk(30), COCO)[..., :2]
    flat = size * (places - places.min(axis=(0, 1))) / np.ptp(places)
    with pytest.raises(CaptureError, match="found places in a picture with a confidence"):
        read(saved(np.concatenate([flat, np.full((30, 17, 1), 0.9)], axis=-1)))


@pytest.mark.parametrize(
    "content",
    [
        saved(np.zeros((30, 19, 3))),
        saved(np.zeros((30, 17, 2))),
        saved(np.zeros((30, 17, 5))),
        saved(np.zeros((30, 52))),
        saved(np.zeros((2, 30, 17, 3))),
        saved(np.zeros((1, 17, 3))),
    ],
)
def test_other_shapes_are_refused(content: bytes) -> None:
    with pytest.raises(CaptureError, match=r"a numpy array that is not of shape \(frames, joints, 3\)"):
        read(content)


def test_two_people_in_an_archive_are_refused() -> None:
    points = joints(walk(30), COCO)
    with pytest.raises(CaptureError, match=r"an \.npz archive of one, two"):
        read(archive(one=points, two=points), "joints.npz")


def test_an_array_of_objects_is_not_unpickled() -> None:
    with pytest.raises(CaptureError, match="a numpy file of Python objects"):
        read(saved(np.array([{"joints": 1}], dtype=object)))


def test_a_file_that_is_cut_off() -> None:
    content = saved(joints(walk(30), COCO))
    with pytest.raises(CaptureError, match="it is damaged"):
        read(content[:-100])
