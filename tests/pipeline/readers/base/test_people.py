"""People whom a tracker loses, finds again and numbers anew, in every format that numbers people."""

from __future__ import annotations

import importlib
import json
import re
from collections.abc import Callable
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


def seen(moments: Array, number: int, at: float) -> tuple[Array, Array, Array]:
    """Somebody who walks at 1.4 m/s from `at` along X."""
    places = BODY + np.array([1.0, 0.0, 0.0]) * (at + 1.4 * moments[:, None, None])
    return moments, np.full(len(moments), number), places


def both(*people: tuple[Array, Array, Array]) -> dict[int, int]:
    moments, numbers, points = (np.concatenate(parts) for parts in zip(*people, strict=True))
    order = np.random.default_rng(1).permutation(len(moments))
    return found_again(moments[order], numbers[order], points[order])


def test_somebody_is_found_again_where_they_were_lost() -> None:
    first, second, third = TIMES[:10], TIMES[11:20], TIMES[30:]
    assert both(seen(first, 5, 0.0), seen(second, 3, 0.0), seen(third, 8, 0.0)) == {3: 5, 8: 5}


def test_units_and_clocks_do_not_matter() -> None:
    moments, numbers, points = seen(TIMES[:10], 5, 0.0)
    others, new, places = seen(TIMES[15:], 6, 0.0)
    for unit in (1.0, 1000.0, 0.01):
        for clock in (1.0, 1e6, 30.0):
            scaled = (clock * np.append(moments, others), unit * np.append(points, places, axis=0))
            assert found_again(scaled[0], np.append(numbers, new), scaled[1]) == {6: 5}


@pytest.mark.parametrize(
    "other",
    [
        seen(TIMES[9:], 6, 0.0),  # seen together
        seen(TIMES[20:], 6, 1.0),  # elsewhere
        seen(TIMES[20:] + 2.0, 6, -2.0),  # much later
        seen(TIMES[:0], 6, 0.0),  # nobody
    ],
    ids=["together", "elsewhere", "later", "nobody"],
)
def test_others_are_not_taken_for_them(other: tuple[Array, Array, Array]) -> None:
    assert both(seen(TIMES[:10], 5, 0.0), other) == {}


def test_of_two_who_are_lost_each_is_found_again() -> None:
    people = [seen(TIMES[:10], 5, 0.0), seen(TIMES[:10], 6, 0.4)]
    people += [seen(TIMES[12:], 7, 0.38), seen(TIMES[12:], 8, 0.02)]
    assert both(*people) == {7: 6, 8: 5}


def test_zeros_and_missing_joints_are_no_places() -> None:
    moments, numbers, points = seen(TIMES[:10], 5, 0.0)
    others, new, places = seen(TIMES[10:], 6, 0.0)
    points[-3:] = 0.0
    places[0, 3:] = np.nan
    everything = np.append(moments, others), np.append(numbers, new), np.append(points, places, axis=0)
    assert found_again(*everything) == {6: 5}


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


def test_tracked_people_of_mediapipe() -> None:
    world = mediapipe.world_landmarks(walk(FRAMES))
    beside = {"frame": np.arange(FRAMES), "track_id": np.where(np.arange(FRAMES) < LATER, 4, NEW)}
    content = mediapipe.table(world, beside)
    source = recognise.Source(Path("pose.csv"), content.encode(), "")
    clip = recognise.read_source(source)
    assert len(clip.times) == FRAMES
    (defect,) = clip.provenance["reading"]["defects"]
    assert defect["rule"] == "renumbered_people"
    assert defect["text"].startswith("a person lost and found again under another number")
