"""Andersson lines: joints in their own order, frames without marks, and every kind of damage."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import source_of
from samples.andersson import ORDER, files
from samples.motion import in_range, walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers.public_datasets import andersson
from kinemimic.pipeline.readers.recognise import read, read_source

PATH = Path("walk.txt")


def sample(frames: int = 12) -> str:
    return files(frames)["Person001_1.txt"].decode()


def clip_of(text: str) -> Clip:
    return read_source(source_of(text, PATH))


def length(clip: Clip, a: str, b: str) -> float:
    ends = (clip.positions[:, NODE_INDEX[node]] for node in (a, b))
    return float(np.nanmedian(np.linalg.norm(np.subtract(*ends), axis=-1)))


def test_the_written_walk_is_read() -> None:
    clip = clip_of(sample())
    assert clip.provenance["format"] == "Andersson lines"
    assert np.abs(clip.positions - in_range(walk(12))).max() < 1e-6
    assert clip.times == pytest.approx(np.arange(12) / 30.0)
    assert (clip.states == 2).all()


def test_the_slow_way_reads_the_same_as_the_fast_one() -> None:
    # A blank line, spaces and a missing last line feed are read line by line.
    text = sample().replace("\r\n", "\n")
    odd = text.replace("Head;", " Head ;", 1).replace("\nSpine", "\n\nSpine", 1).rstrip("\n")
    assert np.array_equal(clip_of(odd).positions, clip_of(text).positions)


def test_names_may_have_any_order_that_repeats() -> None:
    lines = sample().split("\r\n")[:-1]
    turned = [line for k in range(0, len(lines), 20) for line in reversed(lines[k : k + 20])]
    assert np.array_equal(clip_of("\n".join(turned)).positions, clip_of(sample()).positions)


def test_nan_and_the_origin_are_missing() -> None:
    lines = sample().split("\r\n")
    lines[20], lines[45] = "Head;nan;0.1;2", f"{ORDER[5][0]};0;0;0"
    clip = clip_of("\n".join(lines))
    assert np.argwhere(clip.states == 0).tolist() == [[1, NODE_INDEX["head"]], [2, NODE_INDEX[ORDER[5][1]]]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda n: n.pop(30),
            "line 31: expected Spine of frame 1, found 'Hip-centro'; a joint's line is missing",
        ),
        (
            lambda n: n.insert(30, n[29]),
            "line 31: expected Spine of frame 1, found 'Hand-Left'; .* or repeated",
        ),
        (
            lambda n: n.__delitem__(slice(-7, None)),
            "line 233: .* 20 joints in the last frame, found 13; .*cut off",
        ),
        (
            lambda n: n.__setitem__(-1, "Foot-Left;0.1;0"),
            "line 240: expected Foot-Left and 3 numbers, found 2; .*cut",
        ),
        (lambda n: n.__setitem__(50, n[50] + ";1"), "line 51: expected Spine and 3 numbers, found 4$"),
        (lambda n: n.__setitem__(50, "Spine;1;2;1_0"), "line 51: expected a number, found '1_0'"),
        (
            lambda n: n.__setitem__(50, "Spine;1;2;700"),
            "line 41: expected at most 100 m in Z of Spine, found 700",
        ),
        (
            lambda n: n.__delitem__(slice(8, None)),
            "line 8: expected 20 joints in the first frame, found 8, without",
        ),
        (lambda n: n.__setitem__(5, "Tail;1;2;3"), "line 6: expected a joint's name, found 'Tail'"),
    ],
)
def test_damage_names_its_line(change: Callable[[list[str]], object], message: str) -> None:
    lines = sample().split("\r\n")[:-1]
    change(lines)
    with pytest.raises(CaptureError, match=message):
        clip_of("\n".join(lines) + "\n")


def test_recognised_by_names_only() -> None:
    assert andersson.recognises(source_of(sample(), PATH))
    assert not andersson.recognises(source_of("a;1;2;3\nb;1;2;3\n", PATH))


def test_real_recordings(captures: Path) -> None:
    # SOURCE.txt: thigh 0.48 m (0.41 to 0.55), shank 0.39 m; the frames are the lines over 20.
    frames = {
        "001_1": 579,
        "003_2": 619,
        "017_2": 657,
        "020_2": 642,
        "077_2": 627,
        "083_2": 620,
        "097_2": 560,
    }
    thighs, shanks = [], []
    for name, count in frames.items():
        clip = read(captures / "kinect1_andersson_gait" / f"Person{name}.txt")
        assert len(clip.times) == count
        assert (clip.states == 2).all()
        thighs.append(0.5 * (length(clip, "hip_left", "knee_left") + length(clip, "hip_right", "knee_right")))
        shanks.append(
            0.5 * (length(clip, "knee_left", "ankle_left") + length(clip, "knee_right", "ankle_right"))
        )
    assert min(thighs) > 0.40
    assert max(thighs) < 0.55
    assert np.median(thighs) == pytest.approx(0.48, abs=0.03)
    assert np.median(shanks) == pytest.approx(0.39, abs=0.03)
