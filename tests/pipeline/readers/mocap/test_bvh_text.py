"""BVH as text: mistakes name their line; frames that are fewer, wrapped or damaged; spellings of numbers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import source_of

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.mocap import bvh as reader
from kinemimic.pipeline.readers.mocap.bvh_text import MAX_DEPTH, parse

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
        (lambda t: t[:-30], "line 64: expected 37 numbers, found 3.; the file is cut off there"),
        (
            lambda t: t.replace("Frames: 40", "Frames: 999999999"),
            "expected at most 50000000 joints times frames",
        ),
        (lambda t: t.replace("Frames: 40", "Frames: -3"), "a number of frames above 0, found '-3'"),
        (
            lambda t: t.replace("0.0333333\n", "33\n"),
            "expected a frame time of 0.0001 to 1 s, found '33'; write the seconds",
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
        (
            lambda t: t.replace("}\nMOTION", "}\nROOT Other { OFFSET 0 0 0 }\nMOTION"),
            "expected one ROOT, found a second one; export each person",
        ),
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
    cut = f"line {len(wrapped) - 3}: expected 37 numbers, found 30; the file is cut off there"
    with pytest.raises(CaptureError, match=cut):
        reader.read(source_of("\n".join(wrapped[:-1]) + "\n", PATH))
    del wrapped[start + 5]
    says = f"line {start + 7}: expected 10 numbers, as in line {start + 3}, found 7"
    with pytest.raises(CaptureError, match=says):
        reader.read(source_of("\n".join(wrapped) + "\n", PATH))


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
