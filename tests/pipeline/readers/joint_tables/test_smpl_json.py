"""Bodies of the SMPL family in JSON: the same walk as from AMASS's arrays, whoever wrote them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples import smpl_json as sample
from samples import source_of
from samples.motion import rigid_walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import from_rotvec, multiply, rotate, to_matrix, to_rotvec
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.joint_tables.smpl_json import FORMAT

FRAMES = 40
PEOPLE = sample.people(FRAMES)


def read(content: Any) -> Clip:
    return recognise.read_source(source_of(json.dumps(content), Path("walk.json")))


@pytest.fixture(scope="module")
def walk() -> Clip:
    return read([{"frame": number, "annots": [one]} for number, one in enumerate(PEOPLE)])


def test_the_walk(walk: Clip) -> None:
    shown = rigid_walk(FRAMES, sample.RATE)
    assert walk.provenance["format"] == FORMAT.name
    assert walk.rate == pytest.approx(sample.RATE)
    # The pelvis of the file is where the walk's is, whatever way the body leans.
    assert np.abs(walk.positions[:, 0] - shown.root).max() < 2e-3
    up = walk.positions[:, walk.skeleton.index("neck")] - walk.positions[:, 0]
    assert (up[:, 2] > 0.4).all()


def test_each_way_to_write_frames_is_the_same_walk(walk: Clip, tmp_path: Path) -> None:
    for content in (PEOPLE, [[one] for one in PEOPLE], {"fps": 30, "frames": PEOPLE}):
        np.testing.assert_array_equal(read(content).positions, walk.positions)
    lines = "\n".join(map(json.dumps, PEOPLE))
    clip = recognise.read_source(source_of(lines, Path("walk.jsonl")))
    np.testing.assert_array_equal(clip.positions, walk.positions)
    # EasyMocap: a file of each frame, of which every second may have been fitted.
    for number, one in enumerate(PEOPLE):
        (tmp_path / f"{2 * number:06d}.json").write_text(json.dumps([one]))
    clip = recognise.read(tmp_path)
    np.testing.assert_array_equal(clip.positions, walk.positions)
    np.testing.assert_allclose(clip.times, 2.0 * walk.times)


def test_poses_without_the_root_and_of_other_models() -> None:
    whole = read(PEOPLE)
    for width, cut, far in ((69, slice(3, None), 1e-12), (78, slice(None), 1e-12), (87, slice(None), 0.3)):
        others = [
            {**one, "poses": [np.resize(one["poses"][0][cut] + [0.0] * 15, width).tolist()]} for one in PEOPLE
        ]
        clip = read(others)
        # SMPL-X has its origin higher above the pelvis, and the same angles.
        assert np.abs(clip.positions - whole.positions).max() < far
        np.testing.assert_allclose(clip.rotations, whole.rotations, atol=1e-12)
    assert np.abs(clip.positions - whole.positions).max() > 0.1


def test_a_root_within_the_poses_turns_the_body_first() -> None:
    turned, _ = sample.walk(FRAMES)
    half = from_rotvec(np.array([0.0, 0.3, 0.1]))
    rest = to_rotvec(multiply(half * [-1, -1, -1, 1], from_rotvec(turned[:, 0])))
    others = [
        {**one, "Rh": [to_rotvec(half).tolist()], "poses": [[*rest[k], *one["poses"][0][3:]]]}
        for k, one in enumerate(PEOPLE)
    ]
    np.testing.assert_allclose(read(others).rotations, read(PEOPLE).rotations, atol=1e-5)


def test_arrays_by_other_names() -> None:
    turned, path = sample.walk(FRAMES)
    matrices = to_matrix(from_rotvec(turned))
    flat = turned.reshape(FRAMES, -1)
    wanted = read({"poses": flat.tolist(), "trans": path.tolist(), "mocap_framerate": 120})
    assert wanted.rate == pytest.approx(120.0)
    assert np.abs(wanted.positions[:, 0] - path).max() < 1e-9
    of_all: list[dict[str, Any]] = [
        {"global_orient": flat[:, :3].tolist(), "body_pose": flat[:, 3:].tolist(), "transl": path.tolist()},
        {"root_orient": flat[:, :3].tolist(), "pose_body": flat[:, 3:66].tolist(), "trans": path.tolist()},
        {"smpl": [], "poses": turned.tolist(), "trans": path[:, None].tolist()},
    ]
    for content in of_all:
        np.testing.assert_allclose(read(content).positions, wanted.positions, atol=1e-9)
    frames = [
        {
            "frame_id": k,
            "global_orient": matrices[k, 0].tolist(),
            "body_pose": matrices[k, 1:].tolist(),
            "transl": path[k].tolist(),
        }
        for k in range(FRAMES)
    ]
    np.testing.assert_allclose(read(frames).positions, wanted.positions, atol=1e-9)


def test_of_several_people_the_one_in_most_frames() -> None:
    stranger = {**PEOPLE[0], "id": 7, "Th": [[9.0, 9.0, 9.0]]}
    frames = [[stranger, one] if k % 2 else [one] for k, one in enumerate(PEOPLE)]
    clip = read(frames)
    np.testing.assert_array_equal(clip.positions, read(PEOPLE).positions)
    (defect,) = clip.provenance["reading"]["defects"]
    assert defect["rule"] == "several_people"
    # Frames in which he is not seen are a gap of the clock.
    fewer = read([[stranger] if k == 5 else [one] for k, one in enumerate(PEOPLE)])
    assert len(fewer.times) == FRAMES - 1
    assert np.diff(fewer.times).max() == pytest.approx(2.0 / 30.0)


def test_a_camera_that_looks_at_the_body_has_y_down() -> None:
    """Without a calibration, the world is the camera's: the walk is the same, its height as well."""
    turn = from_rotvec(np.array([np.pi / 2, 0.0, 0.0]))
    others = [
        {
            **one,
            "Rh": [to_rotvec(multiply(turn, from_rotvec(np.array(one["Rh"][0])))).tolist()],
            "Th": [rotate(turn, np.array(one["Th"][0])).tolist()],
        }
        for one in PEOPLE
    ]
    clip, wanted = read(others), read(PEOPLE)
    assert np.ptp(np.abs(clip.positions[..., 2]) - np.abs(wanted.positions[..., 2])) < 1e-6


@pytest.mark.parametrize(
    ("changed", "found"),
    [
        ({"Th": [[0.0, 1.0]]}, r"frame 3: expected x, y and z in Th, found \[\[0.0, 1.0\]\]"),
        ({"Rh": None}, "expected an axis-angle vector in Rh, found None"),
        ({"poses": [[0.0] * 70]}, "expected axis-angle vectors of 21, 23, 22, 24, .* joints in poses"),
        ({"poses": [[0.0] * 69]}, "expected poses of one shape in all frames"),
        ({"Th": [[1e9, 0.0, 0.0]]}, "expected metres of at most .* in Th, found 1e"),
    ],
)
def test_what_is_damaged_is_one_clear_line(changed: dict[str, Any], found: str) -> None:
    frames = [{**one, **changed} if k == 3 else one for k, one in enumerate(PEOPLE)]
    with pytest.raises(CaptureError, match=found):
        read(frames)


def test_frames_by_their_numbers_and_clocks_of_their_own(walk: Clip) -> None:
    by_number = {str(2 * k): [one] for k, one in enumerate(PEOPLE)}
    clip = read(dict(sorted(by_number.items())))  # 0, 10, 12 …
    np.testing.assert_array_equal(clip.positions, walk.positions)
    np.testing.assert_allclose(clip.times, 2.0 * walk.times)
    timed = [{"timestamp": k / 60, "people": [one]} for k, one in enumerate(PEOPLE)]
    np.testing.assert_allclose(read(timed).times, 0.5 * walk.times)
    np.testing.assert_allclose(read([{**one, "fps": 60} for one in PEOPLE]).times, 0.5 * walk.times)
    turned, path = sample.walk(FRAMES)
    arrays = {"poses": turned.reshape(FRAMES, -1).tolist(), "trans": path.tolist()}
    stamps = (1e9 + np.arange(FRAMES) / 120).tolist()
    np.testing.assert_allclose(read({**arrays, "timestamps": stamps}).times, 0.25 * walk.times, atol=1e-6)
    # A number that counts detections is no person's.
    counted = read([{**one, "id": k} for k, one in enumerate(PEOPLE)])
    np.testing.assert_array_equal(counted.positions, walk.positions)


def test_rotation_matrices_of_easymocap(walk: Clip) -> None:
    def turned(values: list[list[float]]) -> list[Any]:
        return to_matrix(from_rotvec(np.array(values).reshape(-1, 3))).tolist()

    others = [{**one, "Rh": turned(one["Rh"]), "poses": turned(one["poses"])} for one in PEOPLE]
    np.testing.assert_allclose(read(others).positions, walk.positions, atol=1e-9)


def test_arrays_of_other_lengths_are_refused() -> None:
    turned, path = sample.walk(FRAMES)
    flat, way = turned.reshape(FRAMES, -1).tolist(), path.tolist()
    for content, found in (
        (
            {"poses": flat, "trans": way[1:]},
            r"expected trans of shape \(40, 3\), as poses, found \(39, 1, 3\)",
        ),
        ({"poses": flat, "trans": way[0]}, r"found \(1, 1, 3\)"),
        (
            {"poses": flat, "trans": way, "Rh": way[1:], "Th": way},
            "as many frames in Rh as in poses, 40, found 39",
        ),
        ([{"poses": flat, "trans": way}] * 2, "an object for each frame, found 2 objects of up to 40 frames"),
    ):
        with pytest.raises(CaptureError, match=found):
            read(content)


@pytest.mark.parametrize(
    "content",
    [
        [{"poses": [[0.0] * 70], "trans": [0.0, 0.0, 0.0]}],
        [{"pose": "standing", "translation": [0.0, 0.0, 0.0]}],
        {"poses": [], "trans": []},
    ],
)
def test_what_only_has_the_names_is_not_recognised(content: Any) -> None:
    with pytest.raises(CaptureError) as raised:
        read(content)
    assert "SMPL body" not in str(raised.value)
