"""Kinect v2 .skl: wrong names are detected from the bones, the clock's unit from its step."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import source_of
from samples.kinect2_skl import SDK, WRONG, files, text
from samples.motion import Walk, in_range, kinect_v2_joints, walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK, KINECT_V2_JOINTS
from kinemimic.pipeline.readers.recognise import read, read_source

PATH = Path("walk.skl")


def clip_of(content: str) -> Clip:
    return read_source(source_of(content.replace("\r\n", "\n"), PATH))


def truth(frames: int) -> np.ndarray:
    seen = walk(frames)
    return kinect_v2_joints(Walk(seen.times, in_range(seen), seen.angles))[:, FROM_SDK]


def defects(clip: Clip) -> dict[str, int]:
    return {defect["rule"]: defect["count"] for defect in clip.provenance["reading"]["defects"]}


def test_wrong_names_are_repaired_with_evidence() -> None:
    clip = clip_of(files(20)["walk_v2.skl"].decode())
    assert clip.provenance["format"] == "Kinect v2 .skl text"
    assert clip.skeleton.names == KINECT_V2_JOINTS
    assert np.abs(clip.positions - truth(20)).max() < 1e-12
    assert defects(clip) == {"wrong_names": 24}
    (defect,) = clip.provenance["reading"]["defects"]
    assert defect["action"] == "repaired"
    assert "with the header's names HipRight-KneeRight 0." in defect["text"]
    assert "with the SDK's order HipRight-KneeRight 0." in defect["text"]


def test_right_names_are_believed_in_any_sequence() -> None:
    clip = clip_of(text(20, SDK))
    assert defects(clip) == {}
    lines = text(20, SDK).split("\r\n")
    names = lines[0].split("\t")
    joints = np.random.default_rng(5).permutation(25)
    order = [0, 1, *(2 + 4 * int(j) + k for j in joints for k in range(4)), *range(102, 106)]
    shuffled = "\n".join("\t".join(line.split("\t")[k] for k in order) for line in lines if line)
    assert names[order[2]] != "SpineBase_X"
    assert np.array_equal(clip_of(shuffled).positions, clip.positions)
    assert defects(clip_of(shuffled)) == {}


def test_head_and_neck_exchanged_are_noticed() -> None:
    clip = clip_of(text(20, ("SpineBase", "SpineMid", "Head", "Neck", *SDK[4:])))
    assert defects(clip) == {"wrong_names": 2}
    assert np.abs(clip.positions - truth(20)).max() < 1e-12


@pytest.mark.parametrize(("tick", "unit"), [(1e-7, "100 ns"), (1e-3, "ms"), (1.0, "s")])
def test_the_unit_of_the_clock_is_detected_from_its_step(tick: float, unit: str) -> None:
    clip = clip_of(text(20, SDK, tick=tick))
    assert clip.provenance["reading"]["clock"] == unit
    assert clip.times == pytest.approx(25010.7 + 0.0330377 * np.arange(20))


def test_untracked_zeros_are_missing() -> None:
    lines = text(20, SDK).split("\r\n")
    fields = lines[5].split("\t")
    fields[2:6] = ["0", "0", "0", "0"]
    lines[5] = "\t".join(fields)
    clip = clip_of("\n".join(lines))
    assert np.argwhere(clip.states == 0).tolist() == [[4, KINECT_V2_JOINTS.index("SpineBase")]]
    assert np.isnan(clip.positions[4, KINECT_V2_JOINTS.index("SpineBase")]).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda t: t.replace("KneeLeft_Y", "Knee_Y"),
            "line 1: expected .* 25 joints.*found no column KneeLeft_Y;",
        ),
        (
            lambda t: t.replace("KneeLeft_Y", "Other"),
            "line 1: .*found no column KneeLeft_Y; .* --suggest FILE",
        ),
        (lambda t: t[:-60], "line 21: expected 106 numbers, found .*; the file is cut off there"),
        (lambda t: t.replace("\t2\t", "\t3\t", 1), "line 2: expected a state of .*, 0, 1 or 2, found 3"),
        (lambda t: t.replace("\t1\t", "\tx\t", 1), "line 3: expected a number, found 'x'"),
        (lambda t: t.split("\n")[0], "line 2: expected lines of numbers, found none"),
    ],
)
def test_damage_names_its_line(change: Callable[[str], str], message: str) -> None:
    with pytest.raises(CaptureError, match=message):
        clip_of(change(text(20, WRONG).replace("\r\n", "\n")))


def test_commas_between_the_columns() -> None:
    clip = clip_of(text(20, SDK).replace("\t", ","))
    assert np.abs(clip.positions - truth(20)).max() < 1e-12


def test_a_clock_of_no_kinect_is_refused() -> None:
    with pytest.raises(
        CaptureError, match=r"expected timestamps with steps of 5 to 500 ms, .*, found a median step"
    ):
        clip_of(text(20, SDK, tick=0.01))


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1000.0), ("cm", 100.0)])
def test_wrong_names_in_another_unit(unit: str, factor: float) -> None:
    """The lengths tell the unit, and in it the order; the rule for units scales the clip."""
    lines = [line.split("\t") for line in files(20)["walk_v2.skl"].decode().replace("\r\n", "\n").split("\n")]
    places = {k for k, name in enumerate(lines[0]) if name.endswith(("_X", "_Y", "_Z"))}
    scaled = [
        [f"{factor * float(cell):.6f}" if k in places else cell for k, cell in enumerate(line)]
        for line in lines[1:]
        if len(line) > 1
    ]
    clip = clip_of("\n".join("\t".join(line) for line in [lines[0], *scaled]))
    assert defects(clip) == {"wrong_names": 24}
    checked = check_capture(clip)
    assert np.abs(checked.clip.positions - truth(20)).max() < 1e-6, unit
    assert "wrong_units" in {defect.rule for defect in checked.defects if defect.action == "repaired"}


def test_implausible_bones_are_refused() -> None:
    rng = np.random.default_rng(6)
    lines = text(20, SDK).split("\r\n")
    rows = []
    for line in lines[1:-1]:
        fields = line.split("\t")
        for column in range(2, 102):
            if (column - 2) % 4 < 3:
                fields[column] = f"{rng.uniform(-2, 2):.6f}"
        rows.append("\t".join(fields))
    with pytest.raises(CaptureError, match=r"expected bones within a factor of 1.7 of an adult's"):
        clip_of("\n".join([lines[0], *rows]))


@pytest.mark.parametrize(
    ("name", "frames", "clock", "wrong", "thigh", "shank"),
    [
        ("Karen_happy_20_2", 337, "ms", 2, 0.39, 0.36),
        ("Kinect_v2_v2RanLong", 1824, "100 ns", 24, 0.376, 0.36),
        ("Rachelle_anger_3_1", 250, "100 ns", 24, 0.378, 0.32),
    ],
)
def test_real_recordings(
    captures: Path, name: str, frames: int, clock: str, wrong: int, thigh: float, shank: float
) -> None:
    clip = read(captures / "kinect2_bernstein_skl" / f"{name}.skl")
    assert len(clip.times) == frames
    assert clip.provenance["reading"]["clock"] == clock
    assert clip.rate == pytest.approx(30.27, abs=0.02)
    assert defects(clip) == {"wrong_names": wrong}
    at = {joint: clip.positions[:, KINECT_V2_JOINTS.index(joint)] for joint in KINECT_V2_JOINTS}

    def length(a: str, b: str) -> float:
        return float(np.nanmedian(np.linalg.norm(at[a] - at[b], axis=-1)))

    assert length("HipRight", "KneeRight") == pytest.approx(thigh, abs=0.02)
    assert length("KneeRight", "AnkleRight") == pytest.approx(shank, abs=0.02)
    assert 0.12 < length("HipLeft", "HipRight") < 0.15
    assert np.nanmedian(at["Head"][:, 2]) > np.nanmedian(at["Neck"][:, 2])


def test_columns_of_other_things_are_not_read() -> None:
    head, *rows = text(20, SDK).replace("\r\n", "\n").strip().split("\n")
    more = "\n".join(["\t".join([head, "Ball_X", "Ball_Y"]), *(f"{row}\t7.5\t7.5" for row in rows)])
    clip = clip_of(more)
    assert np.array_equal(clip.positions, clip_of(text(20, SDK)).positions)
    assert "no joints of a Kinect v2, not read: Ball" in clip.provenance["reading"]["notes"]
