"""Tables of MediaPipe's landmarks as programs write them: frame numbers, people, other columns and names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import mediapipe_csv as sample
from samples import source_of
from samples.mediapipe_json import image_landmarks
from samples.motion import walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.landmarks.blaze_pose import LANDMARKS
from kinemimic.pipeline.readers.landmarks.landmark_columns import landmark_columns

FRAMES = 30
SHOWN = walk(FRAMES)
WORLD = sample.world_landmarks(SHOWN)
# A second person, who mirrors the first.
OTHER = WORLD * np.array([-1.0, 1.0, 1.0])
EVEN = np.arange(FRAMES)


def read(text: str) -> Clip:
    return recognise.read_source(source_of(text, Path("pose.csv")))


def check(clip: Clip, frames: Array = EVEN) -> None:
    """The nodes are the walk's in these frames, at 30 Hz."""
    assert clip.times - clip.times[0] == pytest.approx((frames - frames[0]) / 30.0, abs=1e-5)
    truth = sample.about_hips(SHOWN, clip.skeleton.names)[frames]
    assert np.abs(clip.positions - truth).max() < 1e-6


def test_rows_only_of_frames_with_a_person() -> None:
    there = np.delete(EVEN, [4, 5, 6, 7, 20])
    check(read(sample.table(WORLD[there], {"frame": there})), there)


def test_every_other_frame() -> None:
    check(read(sample.table(WORLD[::2], {"frame_index": EVEN[::2]})), EVEN[::2])


@pytest.mark.parametrize("clock", ["seconds", "t", "elapsed"])
def test_other_names_of_the_clock(clock: str) -> None:
    text = sample.table(WORLD, {"frame": EVEN, "processing_time": 0.02 + EVEN % 3, clock: EVEN / 60.0})
    assert read(text).rate == pytest.approx(60.0)


def test_a_column_with_the_rate() -> None:
    assert read(sample.table(WORLD, {"fps": [60] * FRAMES})).rate == pytest.approx(60.0)


def two_people(beside: dict[str, Array], order: str) -> str:
    """The first person in all frames, the second from the tenth on: in turn, swapped, or behind."""
    rows = [(frame, person) for frame in EVEN for person in (0, 1) if person == 0 or frame >= 10]
    if order == "swapped":
        rows.sort(key=lambda row: (row[0], row[1] if row[0] % 2 else -row[1]))
    elif order == "behind":
        rows.sort(key=lambda row: row[1])
    frames, people = np.array(rows).T
    points = np.where(people[:, None, None] == 0, WORLD[frames], OTHER[frames])
    there = {
        name: values[people] if name.startswith("p") else values[frames] for name, values in beside.items()
    }
    return sample.table(points, there)


@pytest.mark.parametrize("order", ["in turn", "swapped", "behind"])
@pytest.mark.parametrize("moment", [{"frame": EVEN}, {"time": EVEN / 30.0}])
@pytest.mark.parametrize("person", [{"person_id": np.array([4, 7])}, {"person": np.array(["Ann", "Bob"])}])
def test_the_person_in_most_frames_is_read(
    order: str, moment: dict[str, Array], person: dict[str, Array]
) -> None:
    clip = read(two_people({**moment, **person}, order))
    check(clip)
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"], defect["action"]) == ("several_people", 1, "repaired")
    assert defect["text"].startswith("1 more in 20 frames, dropped")


@pytest.mark.parametrize("moment", [{"frame": EVEN}, {"time": EVEN / 30.0}])
def test_of_rows_of_one_frame_without_a_number_the_first_is_read(moment: dict[str, Array]) -> None:
    clip = read(two_people(moment, "in turn"))
    check(clip)
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"]) == ("several_people", 1)


def test_numbers_that_are_no_persons() -> None:
    check(read(sample.table(WORLD, {"frame": EVEN, "track_id": EVEN + 50})))
    check(read(sample.table(WORLD, {"frame": [0] * FRAMES, "person": [3] * FRAMES})))


def test_a_row_a_landmark_of_two_people() -> None:
    for named in ([], ["person"]):
        rows = [",".join(["", "frame", *named, "landmark_name", "x", "y", "z"])]
        for frame in EVEN:
            for person, points in enumerate((WORLD, OTHER)):
                rows += [
                    ",".join([f"{len(rows)}", f"{frame}", *([f"{person}"] * len(named)), name, *place])
                    for name, place in zip(LANDMARKS, points[frame].round(9).astype(str), strict=True)
                ]
        clip = read("\n".join(rows) + "\n")
        check(clip)
        (defect,) = clip.provenance["reading"]["defects"]
        assert (defect["rule"], defect["count"]) == ("several_people", 1)


@pytest.mark.parametrize(
    "spelling",
    [
        "{name}.{axis}", "{axis}_{name}", "world_{name}_{axis}", "{name}_world_{axis}",
        "world_landmark_{number}_{axis}", "pose_landmark_{number}_{axis}", "{name}_w{axis}",
    ],
)  # fmt: skip
def test_spellings_of_the_columns(spelling: str) -> None:
    text = sample.table(WORLD, {"time": EVEN / 30.0}, spelling)
    check(read(text))
    check(read(text.replace("_", " ").title()))


@pytest.mark.parametrize("world", ["{name}_world_{axis}", "world_{name}_{axis}", "{name}_w{axis}"])
@pytest.mark.parametrize("world_first", [False, True])
def test_of_image_and_world_landmarks_the_latter_are_read(world: str, world_first: bool) -> None:
    image = sample.table(image_landmarks(WORLD), {"frame": EVEN}).split("\n")
    other = sample.table(WORLD, {"time": EVEN / 30.0}, world).split("\n")
    pairs = zip(other, image, strict=True) if world_first else zip(image, other, strict=True)
    check(read("\n".join(",".join(pair) for pair in pairs if all(pair)) + "\n"))


def test_a_pelvis_and_few_landmarks_are_another_sensors() -> None:
    """All landmarks and a pelvis that a program added are MediaPipe's."""
    lines = sample.table(WORLD, {"time": EVEN / 30.0}, "{name}_{axis}").split("\n")
    pelvis = ["pelvis_x,pelvis_y,pelvis_z", *["0.001,0,0"] * FRAMES, ""]
    check(read("\n".join(f"{line},{more}" if line else "" for line, more in zip(lines, pelvis, strict=True))))
    nodes = [node.replace("hip_center", "pelvis") for node in NODES]
    names = ["_".join(reversed(node.split("_"))) for node in nodes]
    header = ",".join(["time", *(f"{name}_{axis}" for name in names for axis in "xyz")])
    rows = [",".join(map(str, [k / 30.0, *places.ravel()])) for k, places in enumerate(SHOWN.joints)]
    clip = read("\n".join([header, *rows]) + "\n")
    assert clip.provenance["format"] == "joint table"
    assert len(clip.skeleton.names) == len(NODES)


def test_a_field_in_brackets() -> None:
    names = [f"{name} ({field})" for name in LANDMARKS for field in ("x", "visibility")]
    found = landmark_columns(["time", *names])
    assert list(found.values()) == [
        (k, field) for k in range(len(LANDMARKS)) for field in ("x", "visibility")
    ]


def test_landmarks_of_hands_are_not_the_body() -> None:
    hands = sample.table(9.0 + WORLD[:, :21], {}, "left_hand_{number}_{axis}").split("\n")
    body = sample.table(WORLD, {"frame": EVEN}, "pose_{number}_{axis}").split("\n")
    names = [",".join(pair.split(",")[: 21 * 3]) for pair in hands[:1]]
    check(
        read("\n".join(",".join(pair) for pair in zip(body, [*names, *hands[1:]], strict=True) if all(pair)))
    )


@pytest.mark.parametrize("begin", ["2024-05-03 10:11:", "00:00:"])
def test_dates_and_times_of_day(begin: str) -> None:
    check(read(sample.table(WORLD, {"time": [f"{begin}{k / 30:09.6f}" for k in EVEN], "frame": EVEN})))
    with pytest.raises(CaptureError, match="line 2: expected a number, found 'noon'"):
        read(sample.table(WORLD, {"time": ["noon"] * FRAMES}))


@pytest.mark.parametrize("separator", [",", ";"])
def test_columns_of_words(separator: str) -> None:
    text = sample.table(WORLD, {"video": ["a walk.mp4"] * FRAMES, "frame": EVEN, "class": ["walk"] * FRAMES})
    if separator == ";":
        text = text.replace(",", ";").replace("a walk.mp4", "a walk,mp4").replace(".", ",")
    check(read(text))
    with pytest.raises(CaptureError, match="line 3: expected a number, found 'word'"):
        read(sample.table(WORLD, {"video": ["a"] * FRAMES, "time": ["0.0", "word", *EVEN[2:]]}))


@pytest.mark.parametrize("mark", ["landmark", "landmark_id", "landmark_index", "Landmark Name"])
def test_a_row_a_landmark_by_name_or_number(mark: str) -> None:
    named = mark in ("landmark", "Landmark Name")
    rows = [f"frame,time,{mark},x,y,z,visibility"]
    for frame in EVEN:
        rows += [
            f"{frame},{frame / 30:.6f},{LANDMARKS[number].upper() if named else number},"
            + ",".join(f"{value:.9g}" for value in WORLD[frame, number])
            + ",0.9"
            # In the order of the alphabet.
            for number in sorted(range(len(LANDMARKS)), key=LANDMARKS.__getitem__)
        ]
    check(read("\n".join(rows) + "\n"))
    if named:
        with pytest.raises(CaptureError, match="expected a number, found 'TAIL'"):
            read("\n".join(rows).replace("NOSE", "TAIL"))
