"""BVH as text: mistakes name their line; frames that are fewer, wrapped or damaged; spellings of numbers."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import source_of

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.mocap import bvh as reader
from kinemimic.pipeline.readers.mocap.bvh_hierarchy import MAX_DEPTH
from kinemimic.pipeline.readers.mocap.bvh_text import parse

Text = Callable[..., str]
PATH = Path("walk.bvh")
# Every number has digits behind its point.
MOTION = np.round(np.random.default_rng(2026).uniform(-30.0, 30.0, size=(30, 37)), 3) + 0.0001


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda t: t[: t.index("JOINT RightLeg")],
            "line 19: expected OFFSET.*found the end of the file; .*cut off",
        ),
        (lambda t: t[: t.index("MOTION")], "expected MOTION, found the end of the file"),
        (
            lambda t: t[: t.index("Frame Time")],
            "line 24: expected Frame Time: and a number, found the end of",
        ),
        (
            lambda t: t.replace("Frames: 40", "Frames: 999999999"),
            "expected at most 50000000 joints times frames",
        ),
        (
            lambda t: t.replace("0.0333333\n", "30\n"),
            "expected a frame time of .*, found '30'; if these are frames per second, write 0.033333",
        ),
        (
            lambda t: t.replace("0.0333333\n", "3\n"),
            "expected a frame time of 0.0001 to 1 s, found '3'; write the seconds",
        ),
        (lambda t: t.replace("0.0333333\n", "nan\n"), "expected a frame time"),
        (lambda t: t.replace("OFFSET 9 -8 0", "OFFSET 9 -8"), "three numbers after OFFSET, found 'CHANNELS'"),
        (lambda t: t.replace("OFFSET 9 -8 0", "OFFSET 9 nan 0"), "three numbers after OFFSET, found 'nan'"),
        (lambda t: t.replace("CHANNELS 1", "CHANNELS 10"), "expected 0 to 9 channels, found '10'"),
        (lambda t: t.replace("CHANNELS 1", "CHANNELS 2"), "channels among .*, found 'JOINT'"),
        (
            lambda t: t.replace("CHANNELS 3 Xrotation Yrotation", "CHANNELS 3 Xrotation Xrotation"),
            "each once",
        ),
        (
            lambda t: t.replace("CHANNELS 1", "ROT 1"),
            "line 19: expected OFFSET, CHANNELS.*found 'ROT'; BVH has no such",
        ),
        (lambda t: t.replace("ROOT Hips", "ROOT"), "line 3: expected a joint's name, found '{'"),
        (lambda t: t.replace("}\nMOTION", "}\nTwo\nMOTION"), "expected MOTION or another ROOT, found 'Two'"),
    ],
)
def test_mistakes_name_their_line(bvh: Text, change: Callable[[str], str], message: str) -> None:
    with pytest.raises(CaptureError, match=message) as caught:
        reader.read(source_of(change(bvh()), PATH))
    assert "\n" not in str(caught.value)


def test_frames_that_are_there_are_read_whatever_the_file_declares(bvh: Text) -> None:
    fewer = reader.read(source_of("\n".join(bvh().split("\n")[:40]), PATH))
    assert len(fewer.times) == 16
    (defect,) = fewer.provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"], defect["action"]) == ("dropped_frames", 24, "flagged")
    more = reader.read(source_of(bvh().replace("Frames: 40", "Frames: 39"), PATH))
    assert len(more.times) == 40
    assert more.provenance["reading"]["notes"] == ["the file declares 39 frames but has 40: all are read"]


def test_frames_that_are_wrapped_over_several_lines(bvh: Text) -> None:
    lines = bvh().rstrip("\n").split("\n")
    start = next(k for k, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    wrapped = lines[:start]
    for line in lines[start:]:
        words = line.split()
        wrapped += [" ".join(words[k : k + 10]) for k in range(0, len(words), 10)]
    clip = reader.read(source_of("\n".join(wrapped) + "\n", PATH))
    assert np.array_equal(clip.positions, reader.read(source_of(bvh(), PATH)).positions)
    shorter = reader.read(source_of("\n".join(wrapped[:-1]) + "\n", PATH))
    assert np.array_equal(shorter.positions, clip.positions[:-1])
    del wrapped[start + 5]
    says = f"line {start + 7}: expected 10 numbers, as in line {start + 3}, found 7"
    with pytest.raises(CaptureError, match=says):
        reader.read(source_of("\n".join(wrapped) + "\n", PATH))


@pytest.mark.parametrize("line", [-1, -20])
def test_a_last_frame_that_is_cut_off_is_left_out(bvh: Text, line: int) -> None:
    whole = reader.read(source_of(bvh(), PATH))
    lines = bvh().rstrip("\n").split("\n")
    clip = reader.read(source_of("\n".join([*lines[:line], lines[line][:-30]]), PATH))
    assert np.array_equal(clip.positions, whole.positions[: len(clip.times)])
    assert len(clip.times) == 40 + line
    found = [one["text"] for one in clip.provenance["reading"]["defects"]]
    assert found[-1] == "the last frame is cut off, and left out"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("HIERARCHY", "# exported by a script\n\n// in 2026\nHIERARCHY"),
        ("\nMOTION\n", "\nMotion:\n"),
        ("Frames: 40\nFrame Time: 0.0333333", "Frame Time: 0.0333333\nFrames: 40"),
        ("0.0333333\n", "0.0333333 s\n"),
        ("0.0333333\n", "0.0333333 seconds\n"),
        ("Frames: 40", "Frames: -1"),
        ("Frames: 40", "Frames: 0"),
        ("Frames: 40", "Frames:"),
        ("End Site", "EndSite"),
        ("Xrotation", "Xrot"),
        ("Yposition", "Ypos"),
    ],
)
def test_other_spellings_of_the_same_file(bvh: Text, old: str, new: str) -> None:
    assert old in bvh()
    clip = recognise.read_source(source_of(bvh().replace(old, new), PATH))
    whole = reader.read(source_of(bvh(), PATH))
    assert np.array_equal(clip.positions, whole.positions)
    assert clip.provenance["reading"]["defects"] == whole.provenance["reading"]["defects"]


def test_end_sites_may_have_no_channels(bvh: Text) -> None:
    same = reader.read(source_of(re.sub(r"(End Site\s*\{\s*)", r"\1CHANNELS 0 ", bvh()), PATH))
    assert np.array_equal(same.positions, reader.read(source_of(bvh(), PATH)).positions)


def second_tree(text: str, tree: str, numbers: str, *, first: bool) -> str:
    """The file with another tree, and its numbers in every frame."""
    head, _, rest = text.partition("MOTION\n")
    lines = rest.rstrip("\n").split("\n")
    rows = [f"{numbers} {line}" if first else f"{line} {numbers}" for line in lines[2:]]
    trees = head.replace("ROOT", f"{tree}\nROOT", 1) if first else f"{head}{tree}\n"
    return "\n".join([f"{trees}MOTION", *lines[:2], *rows]) + "\n"


@pytest.mark.parametrize("first", [False, True])
def test_of_several_roots_the_one_with_legs_is_read(bvh: Text, first: bool) -> None:
    camera = "ROOT Camera\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n}"
    clip = reader.read(source_of(second_tree(bvh(), camera, "1 2 3", first=first), PATH))
    whole = reader.read(source_of(bvh(), PATH))
    assert np.array_equal(clip.positions, whole.positions)
    assert "other roots are not read: Camera" in clip.provenance["reading"]["notes"]


def test_of_several_people_the_first_is_read(bvh: Text) -> None:
    head, _, rest = bvh().partition("MOTION\n")
    tree = "ROOT" + head.partition("ROOT")[2].rstrip("\n")
    two = second_tree(bvh(), tree, rest.split("\n")[2], first=False)
    clip = reader.read(source_of(two, PATH))
    assert np.array_equal(clip.positions, reader.read(source_of(bvh(), PATH)).positions)
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"], defect["action"]) == ("several_people", 1, "repaired")


def test_decimal_commas(bvh: Text) -> None:
    points = bvh(motion=MOTION)
    commas = reader.read(source_of(points.replace(".", ","), PATH))
    assert np.array_equal(commas.positions, reader.read(source_of(points, PATH)).positions)
    assert commas.provenance["reading"]["notes"] == ["the numbers have decimal commas"]


def test_no_number_in_the_motion(bvh: Text) -> None:
    lines = bvh().split("\n")
    fields = lines[30].split()
    lines[30] = " ".join([*fields[:4], "1,5", *fields[5:]])
    with pytest.raises(CaptureError, match="line 31"):
        reader.read(source_of("\n".join(lines), PATH))
    lines = bvh().split("\n")
    lines[25:] = [f"{line} ".replace(" ", " nan ", 1) for line in lines[25:] if line]
    with pytest.raises(CaptureError, match="expected"):
        reader.read(source_of("\n".join(lines), PATH))


@pytest.mark.parametrize("word", ["nan", "inf", "-1.#IND", "1.#QNAN0", "-nan(ind)"])
def test_a_frame_without_a_number_is_left_out_and_the_others_keep_their_times(bvh: Text, word: str) -> None:
    whole = reader.read(source_of(bvh(), PATH))
    lines = bvh().split("\n")
    fields = lines[30].split()
    lines[30] = " ".join([*fields[:4], word, *fields[5:]])
    clip = reader.read(source_of("\n".join(lines), PATH))
    others = np.arange(40) != 30 - lines.index("Frame Time: 0.0333333") - 1
    assert np.array_equal(clip.times, whole.times[others])
    assert np.array_equal(clip.positions, whole.positions[others])
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"], defect["action"]) == ("dropped_frames", 1, "flagged")


@pytest.mark.parametrize("written", ["0", "", "0.0"])
def test_a_file_without_a_frame_time_is_read_at_30_hz(bvh: Text, written: str) -> None:
    clip = reader.read(source_of(bvh().replace("0.0333333\n", f"{written}\n"), PATH))
    assert clip.rate == pytest.approx(30.0)
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["action"]) == ("wrong_rate", "flagged")


@pytest.mark.parametrize("mark", [", ", ",", "; "])
def test_commas_and_semicolons_between_numbers(bvh: Text, mark: str) -> None:
    head, body = bvh(motion=MOTION).split("Frame Time")
    first, _, rest = body.partition("\n")
    text = f"{head}Frame Time{first}\n{rest.replace(' ', mark)}"
    same = reader.read(source_of(f"{head}Frame Time{first}\n{rest}", PATH))
    assert np.array_equal(reader.read(source_of(text, PATH)).positions, same.positions)


def test_deep_nesting_is_refused_without_exhausting_the_stack() -> None:
    deep = "HIERARCHY\nROOT r {" + "JOINT a {" * 50_000
    with pytest.raises(CaptureError, match=f"nested at most {MAX_DEPTH} deep"):
        parse(source_of(deep, PATH))
