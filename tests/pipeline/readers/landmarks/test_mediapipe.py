"""MediaPipe's landmarks as CSV and JSON, in every layout, and the published files."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import mediapipe_csv as sample
from samples import mediapipe_json as json_sample
from samples import source_of
from samples.motion import walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.landmarks.blaze_pose import LANDMARKS, NUMBER
from kinemimic.pipeline.readers.landmarks.mediapipe_csv import FORMAT

FRAMES = 30
UNSEEN = 2
TEXT = sample.files(FRAMES)["pose_landmarks.csv"].decode()
WORLD = sample.world_landmarks(walk(FRAMES))


def read(text: str, name: str = "pose.csv") -> Clip:
    return recognise.read_source(source_of(text, Path(name)))


def check(clip: Clip, *, unseen: bool = True) -> None:
    """The nodes are the walk's about its hips, with the walk's own angles."""
    shown = walk(FRAMES)
    there = np.arange(FRAMES) != UNSEEN if unseen else np.ones(FRAMES, dtype=bool)
    assert np.abs(clip.times - shown.times).max() < 1e-4
    truth = sample.about_hips(shown, clip.skeleton.names)
    assert np.abs(clip.positions[there] - truth[there]).max() < 1e-6
    if unseen:
        assert np.isnan(clip.positions[UNSEEN]).all()
    angles = leg_angles(to_nodes(clip)[0][there])
    for name in ("knee_left", "knee_right"):
        assert np.abs(angles[name] - shown.angles[name][there]).max() < np.radians(0.1)


def test_a_row_a_frame() -> None:
    clip = read(TEXT)
    check(clip)
    assert "foot_left" in clip.skeleton.names
    assert clip.states[-1, clip.skeleton.index("wrist_left")] == 1
    assert clip.states[0, clip.skeleton.index("wrist_left")] == 2


def camel(name: str) -> str:
    first, *others = name.split("_")
    return first + "".join(map(str.title, others))


@pytest.mark.parametrize("spelling", ["L{}_{}", "{}_{}", "x1", "named", "NAMED", "camelCase", "presence"])
def test_spellings_of_the_columns(spelling: str) -> None:
    names, text = TEXT.split("\n", 1)
    for number in reversed(range(len(LANDMARKS))):
        for field in ("x", "y", "z", "visibility"):
            new = {
                "x1": f"{field[0]}{number + 1}",
                "named": f"{LANDMARKS[number]}_{field}",
                "camelCase": f"{camel(LANDMARKS[number])}{field.title()}",
                "NAMED": f"{LANDMARKS[number].upper()}_{field.upper()}",
                "presence": f"landmark_{number}_{'presence' if field == 'visibility' else field}",
            }.get(spelling) or spelling.format(number, field)
            names = names.replace(f"landmark_{number}_{field}", new)
    check(read(f"{names}\n{text}"))


def named(points: Array, times: str = "time") -> str:
    """A table with the landmarks' names, without visibility, at 60 Hz."""
    names = [times, *(f"{name}_{axis}" for name in LANDMARKS for axis in "xyz")]
    rows = [
        ",".join([f"{k / 60:.6f}", *(f"{value:.9g}" for value in row.ravel())])
        for k, row in enumerate(points)
    ]
    return "\n".join([",".join(names), *rows]) + "\n"


def test_names_without_visibility_are_not_freemocaps_and_their_times_are_read() -> None:
    clip = read(named(WORLD))
    assert clip.provenance["format"] == FORMAT.name
    assert clip.times == pytest.approx(np.arange(FRAMES) / 60, abs=1e-5)
    assert clip.provenance["reading"]["notes"][0] == "times in s (time)"
    untimed = read("\n".join(line.partition(",")[2] for line in named(WORLD).split("\n")))
    assert np.array_equal(untimed.positions, clip.positions)
    assert untimed.rate == pytest.approx(30.0)


def test_landmarks_in_metres_with_the_way_are_told_by_the_size_of_the_body() -> None:
    still, moving = read(named(WORLD)), read(named(WORLD + np.array([0.3, -0.9, 4.0])))
    offset = moving.positions - still.positions
    assert np.abs(offset - offset[0, 0]).max() < 1e-8
    assert still.provenance["reading"]["notes"][1].startswith("the hips stay")
    assert moving.provenance["reading"]["notes"][1].startswith("the hips move")
    # A treadmill at the origin of the axes, where the depth of the hips tells nothing.
    assert read(named(WORLD + np.array([0.0, 0.9, 0.0]))).positions.shape == still.positions.shape
    # In millimetres only if the user says so.
    frames = [{"world_landmarks": frame.tolist()} for frame in 1000.0 * (WORLD + np.array([0.3, -0.9, 4.0]))]
    content = json.dumps(frames)
    with pytest.raises(CaptureError, match=r"a leg of .* image landmarks in pixels"):
        read(content, "pose.json")
    clip = recognise.read_source(Source(Path("pose.json"), content.encode(), "", unit="mm"))
    assert np.abs(clip.positions - moving.positions).max() < 1e-6


def long_rows(landmarks: tuple[int, ...]) -> list[list[str]]:
    return [
        [f"{number},{','.join(f'{value:.9g}' for value in WORLD[frame, number])},0.9" for number in landmarks]
        for frame in range(FRAMES)
    ]


BODY = (0, *range(11, 17), *range(23, 33))


def test_all_landmarks_behind_each_other_under_the_header_of_one() -> None:
    rows = [f"{k},{1000 * k / 30:.6f}," + ",".join(row) for k, row in enumerate(long_rows(BODY))]
    clip = read("\n".join(["Frame,Time (ms),Landmark,X,Y,Z,Visibility", *rows]) + "\n")
    check(clip, unseen=False)
    assert {"head", "hand_left"}.isdisjoint(clip.skeleton.names)


def test_a_row_a_landmark() -> None:
    rows = [f"{k},{k / 30:.6f},{one}" for k, row in enumerate(long_rows(BODY)) for one in row]
    clip = read("\n".join(["frame;time_s;landmark;x;y;z;visibility", *rows]).replace(",", ";") + "\n")
    check(clip, unseen=False)
    with pytest.raises(CaptureError, match="line 24: expected a landmark's number, 0 to 32, found 99"):
        text = "\n".join(["frame,time_s,landmark,x,y,z,visibility", *rows]).split("\n")
        text[23] = text[23].replace(",15,", ",99,")
        read("\n".join(text))


@pytest.mark.parametrize("behind_each_other", [False, True])
def test_a_frame_without_a_person_has_empty_cells(behind_each_other: bool) -> None:
    header = "Frame,Time (ms),Landmark,X,Y,Z,Visibility"
    rows = [header]
    for frame, landmarks in enumerate(long_rows(BODY)):
        begin = f"{frame},{1000 * frame / 30:.6f}"
        if frame in (0, 5):
            rows.append(begin + ",,,,," + ",,,,," * (len(BODY) - 1) * behind_each_other)
        elif behind_each_other:
            rows.append(",".join([begin, *landmarks]))
        else:
            rows += [f"{begin},{one}" for one in landmarks]
    clip = read("\n".join(rows) + "\n")
    assert len(clip.times) == FRAMES
    assert np.flatnonzero(np.isnan(clip.positions).all(axis=(1, 2))).tolist() == [0, 5]


def test_json_of_protobuf_messages() -> None:
    document = json_sample.document(FRAMES)
    same = read(json.dumps(document), "pose.json")
    for key in ("landmark", "landmarks"):
        for whole in (False, True):
            frames = [dict(frame) for frame in document]
            for frame in frames:
                people = frame["pose_world_landmarks"]
                packed = [{key: person} for person in people]
                if whole:
                    packed = packed[0] if packed else {key: []}
                frame["pose_world_landmarks"] = packed
            clip = read(json.dumps(frames), "pose.json")
            assert np.array_equal(clip.positions, same.positions, equal_nan=True)


def test_json_with_image_and_world_landmarks() -> None:
    clip = read(json_sample.files(FRAMES)["pose.json"].decode(), "pose.json")
    check(clip)
    assert clip.provenance["reading"]["key"] == "pose_world_landmarks"


def test_json_of_lists_in_an_object_with_several_people() -> None:
    document = json_sample.document(FRAMES)
    frames = [
        {
            "time": frame["timestamp_ms"] / 1000.0,
            "worldLandmarks": [
                [list(one.values()) for one in person] for person in frame["pose_world_landmarks"]
            ]
            * 2,
        }
        for frame in document
    ]
    clip = read(json.dumps({"fps": 30, "frames": frames}), "pose.json")
    check(clip)
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"]) == ("several_people", FRAMES - 1)


@pytest.mark.parametrize("nobody", [None, {"pose_world_landmarks": None}, {"timestamp_ms": None}])
@pytest.mark.parametrize("number", [0, 7])
def test_a_frame_without_a_person_and_a_time_is_a_gap_of_the_clock(number: int, nobody: object) -> None:
    document: list[object] = list(json_sample.document(FRAMES))
    document[number] = nobody
    clip, shown = read(json.dumps(document), "pose.json"), walk(FRAMES)
    assert clip.provenance["reading"]["notes"][0] == "times in ms (timestamp_ms)"
    times = np.delete(shown.times, number)
    assert clip.times - clip.times[0] == pytest.approx(times - times[0], abs=1e-5)


@pytest.mark.parametrize(
    "stated", [{"fps": 60}, {"video_fps": 60.0}, {"frameRate": 60}, {"metadata": {"frame_rate": 60}}]
)
def test_json_with_the_rate_of_the_video(stated: dict[str, object]) -> None:
    frames = [
        {"pose_world_landmarks": frame["pose_world_landmarks"]} for frame in json_sample.document(FRAMES)
    ]
    clip = read(json.dumps({**stated, "frames": frames}), "pose.json")
    assert clip.times == pytest.approx(np.arange(FRAMES) / 60)
    assert clip.provenance["reading"]["notes"][0].startswith("no time in the file: 60 Hz (")
    assert read(json.dumps(frames), "pose.json").rate == pytest.approx(30.0)
    for wrong in (0, "fast", True, [30]):
        with pytest.raises(CaptureError, match="expected 1 to 1000 frames per second in fps, found"):
            read(json.dumps({"fps": wrong, "frames": frames}), "pose.json")


def test_image_landmarks_are_told_apart_and_refused() -> None:
    image = json_sample.image_landmarks(WORLD)
    names = ",".join(["frame", *(f"L{k}_{axis}" for k in range(len(LANDMARKS)) for axis in "xyz")])
    for scale, says in ((1.0, "image landmarks, shares of a picture"), (1000.0, "image landmarks in pixels")):
        rows = [f"{k}," + ",".join(f"{v:.6f}" for v in scale * row.ravel()) for k, row in enumerate(image)]
        for header in (
            names,
            ",".join(["frame", *(f"{camel(one)}_{axis}" for one in LANDMARKS for axis in "xyz")]),
        ):
            with pytest.raises(CaptureError, match=f"expected world landmarks, .*{says}.*give the video"):
                read("\n".join([header, *rows]) + "\n")
    document = [{"landmarks": frame["pose_landmarks"]} for frame in json_sample.document(FRAMES)]
    with pytest.raises(CaptureError, match="image landmarks, shares of a picture"):
        read(json.dumps(document), "pose.json")


def drop_legs(text: str) -> str:
    return text.replace(f"landmark_{NUMBER['left_knee']}_x", "other")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (drop_legs, "expected hips, knees and ankles, found no left knee"),
        (lambda text: text.replace("timestamp,", "landmark_0_x,", 1), "'landmark_0_x' twice"),
        (lambda text: text.replace("0.98", "high", 1), "line 2: expected a number, found 'high'"),
        (lambda text: text[: len(text) - 50], "numbers, found .*cut off"),
        (lambda text: text.split("\n")[0], "expected lines of numbers, found none"),
    ],
)
def test_damage_is_named(change: Callable[[str], str], says: str) -> None:
    with pytest.raises(CaptureError, match=says):
        read(change(TEXT))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            lambda frames: frames[4]["pose_world_landmarks"][0].pop(),
            "frame 4: expected 33 landmarks .* found 32",
        ),
        (
            lambda frames: frames[4]["pose_world_landmarks"][0][3].update(x="a"),
            "frame 4: expected 33 landmarks",
        ),
        (
            lambda frames: frames[4].update(timestamp_ms="noon"),
            "expected numbers or dates in timestamp_ms, found 'noon'",
        ),
        (
            lambda frames: frames[4]["pose_world_landmarks"][0][3].update(x=1e4),
            "frame 4: expected at most 100 m in X of ",
        ),
        (lambda frames: frames.insert(4, 7), "frame 4: expected a frame with landmarks, found int"),
    ],
)
def test_damaged_json_is_named(change: Callable[[list[object]], object], says: str) -> None:
    frames = json_sample.document(FRAMES)
    change(frames)
    with pytest.raises(CaptureError, match=says):
        read(json.dumps(frames), "pose.json")


def test_published_files(sensors: Path) -> None:
    clip = recognise.read(sensors / "mediapipe_csv" / "vokulovskiy_pose_landmarks.csv")
    positions = to_nodes(clip)[0]
    assert len(clip.times) == 389
    assert clip.rate == pytest.approx(60.0, abs=0.01)
    for side in ("left", "right"):
        hip, knee, ankle = (positions[:, NODE_INDEX[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle"))
        assert 0.33 < np.median(np.linalg.norm(hip - knee, axis=-1)) < 0.5
        assert 0.33 < np.median(np.linalg.norm(ankle - knee, axis=-1)) < 0.45
    for name in ("korok-leaf", "Ash1708"):
        with pytest.raises(CaptureError, match="found image landmarks, shares of a picture"):
            recognise.read(sensors / "mediapipe_csv" / f"{name}_pose_landmarks.csv")
