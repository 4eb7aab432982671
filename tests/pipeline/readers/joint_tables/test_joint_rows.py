"""Tables of joints without names are the body that joint arrays are, or are refused."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from samples.joint_array import joints
from samples.motion import walk

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.landmarks.joint_sets import (
    AZURE_KINECT,
    FIELDS_OF_ROW,
    KINECT_V1,
    KINECT_V2,
    MEDIAPIPE,
    SETS,
    JointSet,
)

FRAMES = 40
HUMAN36M, COCO = SETS[:2]
ZED_34 = next(joint_set for joint_set in SETS if len(joint_set.joints) == 34)
WITHOUT_NAMES = [
    one
    for one in SETS
    if 3 * len(one.joints) in FIELDS_OF_ROW and one not in (KINECT_V1, KINECT_V2, AZURE_KINECT)
]


def places(joint_set: JointSet, rate: float = 30.0) -> Array:
    return joints(walk(FRAMES, rate), joint_set)


def table(rows: Array, header: Sequence[str] = (), separator: str = ",") -> str:
    lines = [",".join(header)] if header else []
    return "\n".join([*lines, *(separator.join(f"{value:.6f}" for value in row) for row in rows)]) + "\n"


def check(path: Path, joint_set: JointSet, rate: float = 30.0) -> None:
    clip = recognise.read(path)
    assert clip.provenance["format"] == "joint rows"
    assert clip.provenance["reading"]["notes"][0].startswith(joint_set.name)
    assert clip.rate == pytest.approx(rate)
    truth = walk(FRAMES, rate).joints[:, [NODE_INDEX[name] for name in clip.skeleton.names]]
    assert clip.positions == pytest.approx(truth, abs=2e-6)


@pytest.mark.parametrize("joint_set", WITHOUT_NAMES, ids=lambda joint_set: joint_set.name)
def test_every_set_that_is_no_sensors(joint_set: JointSet, tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text(
        table(places(joint_set, joint_set.rate).reshape(FRAMES, -1), separator=" ")
    )
    check(tmp_path / "a.txt", joint_set, joint_set.rate)


def numbered(name: str) -> list[str]:
    return [name.format(k=k, axis=axis) for k in range(17) for axis in "xyz"]


ROWS = np.arange(FRAMES)[:, None]
LAYOUTS: dict[str, Callable[[Array], str]] = {
    "pandas' numbers of rows and columns": lambda flat: table(
        np.hstack([ROWS, flat]), ["", *map(str, range(51))]
    ),
    "times": lambda flat: table(np.hstack([ROWS / 50.0, flat])),
    "times in ms, and frame numbers": lambda flat: table(np.hstack([ROWS, 20.0 * ROWS, flat])),
    "numbered joints": lambda flat: table(
        np.hstack([20.0 * ROWS, flat]), ["time_ms", *numbered("kp{k}_{axis}")]
    ),
    "axes with numbers": lambda flat: table(np.hstack([20.0 * ROWS, flat]), ["t_ms", *numbered("{axis}{k}")]),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_headers_and_clocks(layout: str, tmp_path: Path) -> None:
    rate = 30.0 if "pandas" in layout else 50.0
    (tmp_path / "a.csv").write_text(LAYOUTS[layout](places(COCO, rate).reshape(FRAMES, -1)))
    check(tmp_path / "a.csv", COCO, rate)


def test_a_confidence_behind_each_joint(tmp_path: Path) -> None:
    sure = np.ones((FRAMES, 17, 1))
    sure[:10, 13] = 0.2  # the left knee
    (tmp_path / "a.csv").write_text(table(np.concatenate([places(COCO), sure], axis=2).reshape(FRAMES, -1)))
    clip = recognise.read(tmp_path / "a.csv")
    knee = clip.skeleton.names.index("knee_left")
    assert (clip.states[:10, knee] == 1).all()
    assert (clip.states[10:] == 2).all()


def test_more_points_than_mediapipe_are_not_mediapipes(tmp_path: Path) -> None:
    header = [f"{axis}{k}" for k in range(34) for axis in "xyz"]
    (tmp_path / "a.csv").write_text(table(places(ZED_34).reshape(FRAMES, -1), header))
    check(tmp_path / "a.csv", ZED_34)


def test_places_in_a_picture_are_no_body(tmp_path: Path) -> None:
    """COCO's keypoints with their confidence, of which a part looks like OpenNI's joints."""
    flat = np.abs(places(COCO)) * [300.0, 300.0, 0.0] + [0.0, 0.0, 0.9]
    (tmp_path / "a.csv").write_text(table(flat.reshape(FRAMES, -1)))
    with pytest.raises(CaptureError, match="found places in a picture with a confidence"):
        recognise.read(tmp_path / "a.csv")


@pytest.mark.parametrize("pixels", [80.0, 300.0, 900.0])
def test_landmarks_in_pixels_are_no_body(pixels: float, tmp_path: Path) -> None:
    """As a well-known lesson writes them for Unity: with a depth about the hips, in pixels too."""
    shown = places(MEDIAPIPE)
    hips = shown[:, 23:25].mean(axis=1, keepdims=True)
    flat = np.round(pixels * (shown - hips * [0.0, 0.0, 1.0] + [0.5, -2.0, 0.0]))
    (tmp_path / "a.txt").write_text(table(flat.reshape(FRAMES, -1)))
    with pytest.raises(CaptureError, match=r"expected (?:world landmarks|a leg)"):
        recognise.read(tmp_path / "a.txt")


def test_a_damaged_row_is_named(tmp_path: Path) -> None:
    lines = table(places(HUMAN36M).reshape(FRAMES, -1)).splitlines()
    lines[7] = lines[7].rsplit(",", 3)[0]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    with pytest.raises(CaptureError, match="line 8: expected 51 columns, found 48"):
        recognise.read(tmp_path / "a.csv")
