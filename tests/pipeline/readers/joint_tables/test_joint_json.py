"""JSON of joints is read as the same body, whatever its keys are called, or is no capture."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.joint_array import joints
from samples.joint_table import NAMES
from samples.motion import walk, y_up

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError, NotACaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.landmarks.joint_sets import SETS, JointSet

BY_NAME = {one.name: one for one in SETS}
HUMAN36M, COCO = BY_NAME["Human3.6M, 17 joints"], BY_NAME["COCO, 17 keypoints"]
SMPL, BODY_25 = BY_NAME["SMPL, 22 joints"], BY_NAME["OpenPose BODY_25"]
FRAMES, RATE = 45, 25.0
WALK = walk(FRAMES, RATE)
POINTS = y_up(WALK.joints)
TIMES = WALK.times.tolist()
SHUFFLED = [*range(1, 20), 0]
PLACES: list[list[list[float]]] = POINTS.tolist()


def xyz(place: list[float], axes: str = "xyz") -> dict[str, float]:
    return dict(zip(axes, place, strict=True))


def each(frame: Callable[[float, list[list[float]]], Any]) -> list[Any]:
    return [frame(time, places) for time, places in zip(TIMES, PLACES, strict=True)]


def by_name(places: list[list[float]]) -> dict[str, Any]:
    return {name: xyz(place) for name, place in zip(NAMES, places, strict=True)}


def body(number: int, places: list[list[float]]) -> dict[str, Any]:
    return {
        "id": number,
        "joints": {
            name: {"state": "Tracked", "location": one, "rotation": {"x": 0, "y": 0, "z": 0, "w": 1}}
            for name, one in by_name(places).items()
        },
    }


def matrix(place: list[float]) -> list[list[float]]:
    return [[0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [*place, 1.0]]


def node_kinect2(time: float, places: list[list[float]]) -> dict[str, Any]:
    joints = [
        {**xyz(place, ("cameraX", "cameraY", "cameraZ")), "colorX": 0.5, "colorY": 0.25, "trackingState": 2}  # type: ignore[arg-type]
        for place in places
    ]
    return {"time": time, "bodies": [{"bodyIndex": 0, "tracked": False}, {"bodyIndex": 3, "joints": joints}]}


LAYOUTS: dict[str, Callable[[], Any]] = {
    "joints by name": lambda: each(lambda t, places: {"timestamp": 1000 * t, "joints": by_name(places)}),
    "flat names": lambda: each(
        lambda t, places: {
            "t": t, **{f"{name}_{a}": v for name, one in by_name(places).items() for a, v in one.items()}
        }
    ),
    "three numbers each, and the rate": lambda: {
        "meta": {"fps": RATE},
        "frames": each(lambda t, places: {"pose": dict(zip(NAMES, places, strict=True))}),
    },
    "in the sensor's order": lambda: each(lambda t, places: {"time": t, "skeleton": places}),
    "times of ROS": lambda: each(
        lambda t, places: {
            "header": {"seq": round(RATE * t), "stamp": {"sec": int(1e9 + t), "nsec": round(t % 1 * 1e9)}},
            "persons": [{"id": 1, "joints": by_name(places)}],
        }
    ),
    "frames by their numbers": lambda: {
        f"{k}": frame
        for k, frame in enumerate(each(lambda t, places: {"time": t, "joints": by_name(places)}))
    },
    "people in a list": lambda: each(lambda t, places: {"timestamp": t, "bodies": [body(7, places)]}),
    "an order, and people who are not there": lambda: each(node_kinect2),
    "matrices by columns": lambda: each(
        lambda t, places: {"t": t, "joints": dict(zip(NAMES, map(matrix, places), strict=True))}
    ),
    "matrices by rows": lambda: each(
        lambda t, places: {
            "t": t,
            "joints": [
                {"name": name, "transform": np.transpose(matrix(place)).ravel().tolist()}
                for name, place in zip(NAMES, places, strict=True)
            ],
        }
    ),
    "names beside the frames": lambda: {
        "meta": {"id2name": {f"{k}": NAMES[j] for k, j in enumerate(SHUFFLED)}},
        "frames": each(lambda t, places: {"t": t, "people": [{"points": [places[j] for j in SHUFFLED]}]}),
    },
}  # fmt: skip


def check(path: Path) -> None:
    clip = check_capture(recognise.read(path)).clip
    assert clip.provenance["format"] == "joint JSON"
    assert clip.times[-1] - clip.times[0] == pytest.approx(TIMES[-1], rel=1e-3)
    truth = leg_angles(WALK.joints, times=np.array(TIMES))
    for name, found in leg_angles(to_nodes(clip)[0], times=clip.times).items():
        assert np.degrees(np.abs(found - truth[name])).max() < 0.1, name


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_same_body_from_every_layout(layout: str, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps(LAYOUTS[layout]()))
    check(tmp_path / "a.json")


def test_a_frame_in_each_line(tmp_path: Path) -> None:
    lines = each(lambda t, places: json.dumps({"time": t, "joints": by_name(places)}))
    (tmp_path / "a.json").write_text("\n".join(lines))
    check(tmp_path / "a.json")


def in_row(points: Array) -> list[float]:
    """As OpenPose writes them, with a confidence."""
    return np.concatenate([points, np.full((len(points), 1), 0.9)], axis=1).ravel().tolist()


# As MMPose, EasyMocap and OpenPose write them, a motion's generator, and in the browser.
LISTS: dict[str, tuple[JointSet, Callable[[Array], Any]]] = {
    "of people in frames": (
        HUMAN36M,
        lambda shown: [
            {"frame_id": k, "instances": [{"keypoints": one.tolist(), "keypoint_scores": [0.9] * 17}]}
            for k, one in enumerate(shown)
        ],
    ),
    "of nothing but people": (
        BODY_25,
        lambda shown: [
            [{"id": 0, "keypoints3d": [[*place, 0.9] for place in one.tolist()]}] for one in shown
        ],
    ),
    "in a row": (
        BODY_25,
        lambda shown: {
            "frames": [
                {"people": [{"pose_keypoints_2d": [], "pose_keypoints_3d": in_row(one)}]} for one in shown
            ]
        },
    ),
    "of the whole motion": (SMPL, lambda shown: {"motion": {"fps": 30, "joints": shown.tolist()}}),
    "under MediaPipe's key": (
        COCO,
        lambda shown: [{"keypoints3D": [xyz(place) for place in one.tolist()]} for one in shown],
    ),
}


@pytest.mark.parametrize("layout", LISTS)
def test_lists_without_names(layout: str, tmp_path: Path) -> None:
    joint_set, content = LISTS[layout]
    (tmp_path / "a.json").write_text(json.dumps(content(joints(walk(FRAMES, 30.0), joint_set))))
    clip = recognise.read(tmp_path / "a.json")
    assert clip.provenance["format"] == "joint JSON"
    assert clip.provenance["reading"]["notes"][0].startswith(joint_set.name)
    assert clip.rate == pytest.approx(30.0)
    truth = walk(FRAMES, 30.0).joints[:, [NODE_INDEX[name] for name in clip.skeleton.names]]
    assert clip.positions == pytest.approx(truth, abs=1e-6)


def test_places_in_a_picture_are_named(tmp_path: Path) -> None:
    flat = np.abs(joints(walk(FRAMES), COCO)) * [100.0, 100.0, 0.0] + [0.0, 0.0, 0.9]
    (tmp_path / "a.json").write_text(json.dumps([{"keypoints": one.tolist()} for one in flat]))
    with pytest.raises(CaptureError, match="found places in a picture with a confidence"):
        recognise.read(tmp_path / "a.json")


def test_people_are_told_by_their_numbers_not_their_places(tmp_path: Path) -> None:
    """The second comes in front of the first in the list, and leaves again."""
    frames = []
    for number, (time, places) in enumerate(zip(TIMES, PLACES, strict=True)):
        other = body(2, np.add(places, [1.5, 0.0, 0.5]).tolist())
        bodies = [other, body(1, places)] if 10 < number < 30 else [body(1, places)]
        frames.append({"timestamp": time, "bodies": bodies})
    (tmp_path / "a.json").write_text(json.dumps(frames))
    check(tmp_path / "a.json")
    (defect,) = recognise.read(tmp_path / "a.json").provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"], defect["action"]) == ("several_people", 1, "repaired")


def test_frames_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    """Sorted as words by the program that wrote them, at every second frame of a camera at 50 Hz."""
    of_frames = {f"{2 * k}": by_name(places) for k, places in enumerate(PLACES)}
    content = {"fps": 2 * RATE, "frames": dict(sorted(of_frames.items()))}
    for one in (content, dict(sorted(of_frames.items()))):
        (tmp_path / "a.json").write_text(json.dumps(one))
        clip = recognise.read(tmp_path / "a.json")
        assert clip.times[-1] - clip.times[0] == pytest.approx(
            2 * (FRAMES - 1) / (2 * RATE if "fps" in one else 30)
        )
        assert np.abs(np.diff(clip.positions[:, 0], axis=0)).max() < 0.1


def test_numbered_people_are_no_frames(tmp_path: Path) -> None:
    frames = each(lambda t, places: {"time": t, "joints": by_name(places)})
    (tmp_path / "a.json").write_text(json.dumps({"body0": frames, "body1": frames[:20]}))
    check(tmp_path / "a.json")


@pytest.mark.parametrize("number", [True, False])
def test_frames_in_which_somebody_is_not_seen_are_a_gap(number: bool, tmp_path: Path) -> None:
    """Without a clock, the place of a frame in the list is its time; nobody is seen at the end."""
    missing = range(15, 30)
    frames: list[dict[str, Any]] = []
    for k, places in enumerate(PLACES):
        other = {**body(2, np.add(places, [1.5, 0.0, 0.5]).tolist()), **({} if number else {"id": None})}
        own = [] if k in missing else [body(1, places)]
        frames.append({"bodies": [*own, *([other] if number and k > 20 else [])]})
    frames += [{"bodies": []}] * 2
    (tmp_path / "a.json").write_text(json.dumps(frames))
    clip = recognise.read(tmp_path / "a.json")
    assert len(clip.times) == FRAMES - len(missing)
    assert clip.times[-1] - clip.times[0] == pytest.approx((FRAMES - 1) / 30)
    assert np.diff(clip.times).max() == pytest.approx((len(missing) + 1) / 30)


def test_a_few_joints_with_their_visibility_are_no_landmarks_of_mediapipe(tmp_path: Path) -> None:
    def seen(places: list[list[float]]) -> dict[str, Any]:
        return {name: {**one, "visibility": 0.9} for name, one in by_name(places).items()}

    (tmp_path / "a.json").write_text(json.dumps(each(lambda t, places: {"time": t, "joints": seen(places)})))
    check(tmp_path / "a.json")


@pytest.mark.parametrize(
    "content", [{"joints": 3}, [{"joints": [1, 2]}], [{"skeleton": [[0, 0, 0]] * 20}] * 9]
)
def test_other_json_is_no_capture(content: Any, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps(content))
    with pytest.raises(NotACaptureError, match=r"expected (?:frames with joints|a list of frames)"):
        recognise.read(tmp_path / "a.json")


def test_integers_beyond_any_float_are_no_joints(tmp_path: Path) -> None:
    frame = {"keypoints": [[k, 10**400, -1.0] for k in range(17)]}
    (tmp_path / "a.json").write_text(json.dumps([frame] * 12))
    with pytest.raises(NotACaptureError, match="expected frames with joints"):
        recognise.read(tmp_path / "a.json")
