"""JSON of MediaPipe's landmarks in the shapes in which programs save it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples import mediapipe_csv as sample
from samples import source_of
from samples.mediapipe_json import image_landmarks
from samples.motion import walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.landmarks.blaze_pose import LANDMARKS

FRAMES = 30
SHOWN = walk(FRAMES)
WORLD = sample.world_landmarks(SHOWN)
EVEN = np.arange(FRAMES)


def landmarks(points: Array, visible: str = "visibility") -> list[dict[str, float]]:
    return [dict(zip(("x", "y", "z", visible), (*row, 0.9), strict=True)) for row in points.round(9).tolist()]


BODIES = [landmarks(points) for points in WORLD]


def read(content: object) -> Clip:
    text = content if isinstance(content, str) else json.dumps(content)
    return recognise.read_source(source_of(text, Path("pose.json")))


def check(clip: Clip, frames: Array = EVEN, rate: float = 30.0) -> None:
    """The nodes are the walk's in these frames."""
    assert clip.times - clip.times[0] == pytest.approx((frames - frames[0]) / rate, abs=1e-5)
    truth = sample.about_hips(SHOWN, clip.skeleton.names)[frames]
    assert np.abs(clip.positions - truth).max() < 1e-6


@pytest.mark.parametrize("name", ["frame", "frame_index", "frameNumber"])
def test_frames_only_of_a_person(name: str) -> None:
    there = np.delete(EVEN, [4, 5, 6, 7, 20])
    frames = [{name: int(k), "world_landmarks": BODIES[k]} for k in there]
    check(read(frames), there)
    check(read({"fps": "60", "frames": frames}), there, rate=60.0)


@pytest.mark.parametrize("clock", ["timestamp_sec", "time_seconds", "t", "frame_time", "timestampSec"])
def test_names_of_the_clock(clock: str) -> None:
    frames = [{"latency_time": 0.03, clock: k / 60.0, "landmarks": body} for k, body in enumerate(BODIES)]
    check(read(frames), rate=60.0)


def test_dates_and_times_of_day() -> None:
    for begin in ("2024-05-03T10:11:", "10:11:"):
        frames = [{"timestamp": f"{begin}{k / 30:09.6f}", "landmarks": body} for k, body in enumerate(BODIES)]
        check(read(frames))


def test_the_rate_in_an_object_of_an_object() -> None:
    document = {"video": {"info": {"fps": 60.0}}, "frames": [{"pose": body} for body in BODIES]}
    check(read(document), rate=60.0)


def test_frames_by_their_numbers() -> None:
    for spelling in ("{}", "frame_{:04}"):
        there = np.delete(EVEN, [11, 12])
        frames = {spelling.format(k): {"pose_world_landmarks": BODIES[k]} for k in there}
        check(read(frames), there)
        # In the order of the alphabet.
        check(read({"metadata": {"fps": 30}, "frames": dict(sorted(frames.items()))}), there)
        check(read({name: frame["pose_world_landmarks"] for name, frame in frames.items()}), there)


@pytest.mark.parametrize("spell", [str, str.upper, lambda name: name.replace("_", " ")])
@pytest.mark.parametrize("listed", [False, True])
def test_landmarks_by_their_names(spell: Any, listed: bool) -> None:
    frames = []
    for body in BODIES:
        shown: list[Any] = [list(one.values())[:3] for one in body] if listed else body
        named = {spell(name): one for name, one in zip(LANDMARKS, shown, strict=True)}
        # No node needs them.
        del named[spell("nose")], named[spell("mouth_left")]
        frames.append({"pose_world_landmarks": named})
    check(read(frames))


def test_landmarks_by_their_numbers() -> None:
    check(read([{"landmarks": {str(k): one for k, one in enumerate(body)}} for body in BODIES]))


def test_a_frame_in_each_line() -> None:
    lines = [json.dumps({"time": k / 30.0, "pose_world_landmarks": body}) for k, body in enumerate(BODIES)]
    check(read("\n".join(lines) + "\n\n"))
    lines[4] = lines[4].replace("}", "", 1)
    with pytest.raises(CaptureError, match=r"line 5, column .* expected JSON"):
        read("\n".join(lines))


def test_lists_of_landmarks() -> None:
    check(read(BODIES))
    clip = read([None, [], *BODIES])
    assert np.isnan(clip.positions[:2]).all()
    assert np.abs(clip.positions[2:] - read(BODIES).positions).max() == 0.0


def test_landmarks_in_an_object_of_the_pose() -> None:
    image = [landmarks(points) for points in image_landmarks(WORLD)]
    frames = [
        {"time": k / 30.0, "pose": {"landmarks": flat, "world_landmarks": body}}
        for k, (flat, body) in enumerate(zip(image, BODIES, strict=True))
    ]
    clip = read(frames)
    check(clip)
    assert clip.provenance["reading"]["key"] == "world_landmarks"


@pytest.mark.parametrize("key", [None, "poses", "people"])
def test_people_in_a_list(key: str | None) -> None:
    frames: list[Any] = []
    for k, body in enumerate(BODIES):
        people = [{"keypoints3D": body, "id": 1}, {"keypoints3D": BODIES[-k], "id": 2}][: 2 if k < 8 else 1]
        frames.append(people if key is None else {"frame": k, key: people})
    clip = read(frames)
    check(clip)
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"], defect["unit"]) == ("several_people", 8, "frames")


def test_keypoints_of_tensorflow() -> None:
    for visible, state in ((0.9, 2), (0.2, 1)):
        frames = [
            {
                "keypoints": [{"x": 100.0, "y": 200.0, "score": visible}] * len(LANDMARKS),
                "keypoints3D": [{**one, "score": visible} for one in landmarks(points, "score")],
            }
            for points in WORLD
        ]
        clip = read(frames)
        check(clip)
        assert (clip.states == state).all()


def test_an_entry_of_each_person_of_a_frame() -> None:
    mirrored = [landmarks(points * np.array([-1.0, 1.0, 1.0])) for points in WORLD]
    frames = [
        {"frame": k, "person_id": person, "world_landmarks": bodies[k]}
        for k in range(FRAMES)
        for person, bodies in ((3, BODIES), (8, mirrored))
        if person == 3 or k > 5
    ]
    clip = read(frames)
    check(clip)
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"]) == ("several_people", 1)
    assert defect["text"].endswith("body 3 is seen in most")


def test_other_objects_are_refused() -> None:
    with pytest.raises(CaptureError, match=r"expected 33 landmarks .* found dict"):
        read([{"pose_world_landmarks": {"left_tail": {"x": 0.0, "y": 0.0, "z": 0.0}}}])
    with pytest.raises(CaptureError, match="expected frames with pose_world_landmarks, found none"):
        read({"frames": {"a": BODIES[0], "b": BODIES[1]}})
    with pytest.raises(CaptureError, match="expected numbers or dates in time_of_day, found 'noon'"):
        read([{"time_of_day": "noon" if k == 3 else k / 30.0, "pose": body} for k, body in enumerate(BODIES)])
