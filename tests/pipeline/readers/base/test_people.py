"""People whom a tracker loses, finds again and numbers anew, in every format that numbers people."""

from __future__ import annotations

import importlib
import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples import azure_kinect, ntu_rgbd, unity_recording
from samples import mediapipe_csv as mediapipe
from samples.motion import walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.base.people import found_again

FRAMES, LATER = 60, 30
NEW = 77
BODY = np.random.default_rng(2026).normal(size=(20, 3)) * [0.2, 0.2, 0.45]
TIMES = np.arange(40) / 30.0


def seen(moments: Array, number: int, at: float, size: float = 1.0) -> tuple[Array, Array, Array]:
    """Somebody who walks at 1.4 m/s from `at` along X, 3 m in front of a camera."""
    places = (
        size * BODY
        + np.array([0.0, 3.0, 0.0])
        + np.array([1.0, 0.0, 0.0]) * (at + 1.4 * moments[:, None, None])
    )
    return moments, np.full(len(moments), number), places


def both(*people: tuple[Array, Array, Array]) -> Mapping[int, int]:
    moments, numbers, points = (np.concatenate(parts) for parts in zip(*people, strict=True))
    order = np.random.default_rng(1).permutation(len(moments))
    return found_again(moments[order], numbers[order], points[order]).same


def test_somebody_is_found_again_where_they_were_lost() -> None:
    first, second, third = TIMES[:10], TIMES[11:20], TIMES[30:]
    assert both(seen(first, 5, 0.0), seen(second, 3, 0.0), seen(third, 8, 0.0)) == {3: 5, 8: 5}


def test_units_and_clocks_do_not_matter() -> None:
    moments, numbers, points = seen(TIMES[:10], 5, 0.0)
    others, new, places = seen(TIMES[15:], 6, 0.0)
    for unit in (1.0, 1000.0, 0.01):
        for clock in (1.0, 1e6, 30.0):
            scaled = (clock * np.append(moments, others), unit * np.append(points, places, axis=0))
            assert found_again(scaled[0], np.append(numbers, new), scaled[1]).same == {6: 5}


@pytest.mark.parametrize(
    "other",
    [
        seen(TIMES[9:], 6, 0.0),  # seen together
        seen(TIMES[20:], 6, 1.0),  # elsewhere
        seen(TIMES[20:] + 2.0, 6, -2.8),  # much later
        seen(TIMES[20:], 6, 0.0, 0.7),  # a child
        seen(np.append(TIMES[5:6], TIMES[20:]), 6, 0.0),  # seen before already
    ],
    ids=["together", "elsewhere", "later", "child", "before"],
)
def test_others_are_not_taken_for_them(other: tuple[Array, Array, Array]) -> None:
    assert both(seen(TIMES[:10], 5, 0.0), other) == {}


def test_of_two_who_are_lost_each_is_found_again() -> None:
    people = [seen(TIMES[:10], 5, 0.0), seen(TIMES[:10], 6, 0.4)]
    people += [seen(TIMES[12:], 7, 0.38), seen(TIMES[12:], 8, 0.02)]
    assert both(*people) == {7: 6, 8: 5}


def test_zeros_and_missing_joints_are_no_places() -> None:
    moments, numbers, points = seen(TIMES[:20], 5, 0.0)
    others, new, places = seen(TIMES[10:], 6, 0.0)
    points[8:] = 0.0  # listed for as long as the new number
    places[0, 3:] = np.nan
    everything = np.append(moments, others), np.append(numbers, new), np.append(points, places, axis=0)
    found = found_again(*everything)
    assert found.same == {6: 5}
    assert (found.people == 5).all()
    # Of two rows of a moment, the one with places is kept; where nobody has places, the row that is there.
    assert np.flatnonzero(~found.kept).tolist() == list(range(10, 20))


@pytest.mark.parametrize("value", [1e200, 1e308, -1e308, np.inf, np.nan])
def test_coordinates_that_are_none(value: float) -> None:
    moments, numbers, points = seen(TIMES[:10], 5, 0.0)
    others, new, places = seen(TIMES[12:], 6, 0.0)
    points[-1] = value
    places[0, 0] = value
    everything = np.append(moments, others), np.append(numbers, new), np.append(points, places, axis=0)
    assert found_again(*everything).same == {6: 5}


def test_times_that_are_none() -> None:
    moments, numbers, points = seen(TIMES[:10], 5, 0.0)
    others, new, places = seen(TIMES[12:], 6, 0.0)
    clock = np.full(len(moments) + len(others), np.nan)
    assert found_again(clock, np.append(numbers, new), np.append(points, places, axis=0)).same == {}


def test_bodies_about_the_origin_show_no_place() -> None:
    moments, numbers, points = seen(TIMES[:10], 5, 0.0)
    others, new, places = seen(TIMES[12:], 6, 0.0)
    both_points = np.append(points, places, axis=0)
    both_points -= both_points.mean(axis=1, keepdims=True)
    assert found_again(np.append(moments, others), np.append(numbers, new), both_points).same == {}


def in_json(key: str, person: int) -> Callable[[str], str]:
    """A change of the person's number in the later frames of a document of `frames`, or by their times."""

    def change(text: str) -> str:
        document: Any = json.loads(text)
        frames = document.get("frames") or list(document.values())
        for frame in frames[LATER:]:
            for body in frame.get("bodies", frame.get("body_list")):
                body[key] = NEW if body[key] == person else body[key]
        return json.dumps(document)

    return change


def in_columns(separator: str, column: int, person: int) -> Callable[[str], str]:
    """The same in the later half of the lines of a table."""

    def change(text: str) -> str:
        rows = [line.split(separator) for line in text.splitlines()]
        for row in rows[len(rows) // 2 :]:
            row[column] = str(NEW) if row[column] == str(person) else row[column]
        return "\n".join(separator.join(row) for row in rows) + "\n"

    return change


def in_lines(pattern: str, replacement: str) -> Callable[[str], str]:
    """The same by a replacement in each of the later lines."""

    def change(text: str) -> str:
        lines = text.splitlines()
        half = len(lines) // 2
        return "\n".join([*lines[:half], *(re.sub(pattern, replacement, one) for one in lines[half:])]) + "\n"

    return change


def numbered(text: str) -> str:
    """A joint table with a column of the person's number."""
    header, *rows = text.splitlines()
    return "\n".join([f"bodyId,{header}", *(f"4,{row}" for row in rows)]) + "\n"


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("azure_kinect", in_json("body_id", azure_kinect.PERSON)),
        ("azure_csv", in_columns(";", 1, azure_kinect.PERSON)),
        ("zed_json", in_json("id", 4)),
        ("nuitrack_csv", in_columns(",", 3, 1)),
        ("ntu_rgbd", in_lines(rf"^{ntu_rgbd.PERSON} ", f"{NEW} ")),
        ("unity_recording", in_lines(rf",1,{unity_recording.PERSON},", f",1,{NEW},")),
        ("joint_table", in_columns(",", 0, 4)),
    ],
)
def test_the_capture_goes_on(name: str, change: Callable[[str], str], tmp_path: Path) -> None:
    sample = importlib.import_module(f"samples.{name}")
    for folder in ("plain", "changed"):
        (tmp_path / folder).mkdir()
        for file, content in sample.files(FRAMES).items():
            text = numbered(content.decode()) if name == "joint_table" else content.decode()
            (tmp_path / folder / file).write_text(change(text) if folder == "changed" else text)
    file = next(iter(sample.files(FRAMES)))
    assert (tmp_path / "plain" / file).read_text() != (tmp_path / "changed" / file).read_text()
    plain, clip = (recognise.read(tmp_path / folder / file) for folder in ("plain", "changed"))
    assert np.array_equal(clip.times, plain.times)
    assert np.array_equal(clip.positions, plain.positions, equal_nan=True)
    defects, before = (
        [(one["rule"], one["action"]) for one in c.provenance["reading"]["defects"]] for c in (clip, plain)
    )
    assert sorted(defects) == sorted([*before, ("renumbered_people", "repaired")])


@pytest.mark.parametrize("name", ["azure_kinect", "zed_json", "ntu_rgbd", "joint_table"])
def test_a_number_that_is_still_listed_with_zeros(name: str, tmp_path: Path) -> None:
    """For three frames, at zeros, before or behind the body that the person now is."""
    sample = importlib.import_module(f"samples.{name}")
    ((file, content), *_) = sample.files(FRAMES).items()
    text = numbered(content.decode()) if name == "joint_table" else content.decode()
    change = {
        "azure_kinect": in_json("body_id", azure_kinect.PERSON),
        "zed_json": in_json("id", 4),
        "ntu_rgbd": in_lines(rf"^{ntu_rgbd.PERSON} ", f"{NEW} "),
        "joint_table": in_columns(",", 0, 4),
    }[name]
    found = []
    for number, listed in enumerate((change(text), still_listed(name, change(text)))):
        (tmp_path / str(number)).mkdir()
        (tmp_path / str(number) / file).write_text(listed)
        found.append(recognise.read(tmp_path / str(number) / file))
    assert np.array_equal(found[0].times, found[1].times)
    assert np.array_equal(found[0].positions, found[1].positions, equal_nan=True)


def still_listed(name: str, text: str) -> str:
    """The old number in three later frames, its joints at zero."""
    if name == "joint_table":
        rows = text.splitlines()
        for at in range(len(rows) - 3, len(rows)):
            cells = rows[at].split(",")
            rows.append(",".join(["4", cells[1], *["0.0"] * (len(cells) - 2)]))
        return "\n".join(sorted(rows[1:], key=lambda row: float(row.split(",")[1]))).join(
            [f"{rows[0]}\n", "\n"]
        )
    if name == "ntu_rgbd":
        return zeros_in_ntu(text)
    document: Any = json.loads(text)
    frames = document.get("frames") or list(document.values())
    for number, frame in enumerate(frames[-3:]):
        bodies = frame.get("bodies", frame.get("body_list"))
        gone = json.loads(
            json.dumps(next(one for one in bodies if NEW in (one.get("id"), one.get("body_id"))))
        )
        if name == "azure_kinect":
            gone |= {"body_id": azure_kinect.PERSON, "joint_positions": [[0.0] * 3] * 32}
            frame["num_bodies"] += 1
        else:
            gone |= {"id": 4, "keypoint": [dict.fromkeys("xyz", 0.0)] * len(gone["keypoint"])}
        bodies.insert(number % 2, gone)
    return json.dumps(document)


def zeros_in_ntu(text: str) -> str:
    """The old body again, behind the new one in the last frame, its joints at zero."""
    lines = text.splitlines()
    at = max(k for k, line in enumerate(lines) if line.startswith(f"{NEW} "))
    body = lines[at : at + 27]
    body[0] = body[0].replace(str(NEW), str(ntu_rgbd.PERSON), 1)
    body[2:] = [" ".join(["0"] * 3 + line.split()[3:]) for line in body[2:]]
    count = max(k for k in range(at) if len(lines[k].split()) == 1 and lines[k] != "25")
    lines[count] = str(int(lines[count]) + 1)
    return "\n".join([*lines[: at + 27], *body, *lines[at + 27 :]]) + "\n"


@pytest.mark.parametrize(("ahead", "people"), [(0.0, "several_people"), (3.0, "renumbered_people")])
def test_landmarks_about_the_hips_show_no_place(ahead: float, people: str) -> None:
    world = mediapipe.world_landmarks(walk(FRAMES)) + np.array([0.0, 0.0, ahead])
    beside = {"frame": np.arange(FRAMES), "track_id": np.where(np.arange(FRAMES) < LATER + 5, 4, NEW)}
    content = mediapipe.table(world, beside)
    clip = recognise.read_source(recognise.Source(Path("pose.csv"), content.encode(), ""))
    assert len(clip.times) == (FRAMES if ahead else LATER + 5)
    (defect,) = clip.provenance["reading"]["defects"]
    assert defect["rule"] == people
