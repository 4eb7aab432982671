"""Motive's exports, written here from the known walk, and the published takes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import motive_csv as sample
from samples import source_of
from samples.motion import in_sight, walk
from samples.uiprmd_vicon import MARKERS, plug_in_gait

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise

FRAMES = 30
TEXT = sample.files(FRAMES)["walk.csv"].decode()
SHOWN = in_sight(walk(FRAMES, sample.RATE))


def read(text: str) -> Clip:
    return recognise.read_source(source_of(text, Path("walk.csv")))


def test_bones_are_joints() -> None:
    clip = read(TEXT)
    assert np.abs(clip.times - SHOWN.times).max() < 1e-9
    for node in sample.BONES.values():
        off = clip.positions[:, clip.skeleton.index(node)] - SHOWN.joints[:, NODE_INDEX[node]]
        assert np.abs(off).max() < 1e-8


@pytest.mark.parametrize(
    ("unit", "factor"), [("Meters", 1.0), ("Centimeters", 100.0), ("Inches", 1.0 / 0.0254)]
)
def test_the_unit_is_the_headers(unit: str, factor: float) -> None:
    places = {name: factor * place for name, place in sample.bones(FRAMES).items()}
    clip = read(sample.text("Bone", places, unit=unit))
    assert np.abs(clip.positions - read(TEXT).positions).max() < 2e-6


def test_named_markers_without_a_skeleton() -> None:
    places = {label: place[:, [1, 2, 0]] * 1000.0 for label, place in plug_in_gait(SHOWN).items()}
    places["LELB"][3] = np.nan
    clip = read(sample.text("Marker", {f"Walker:{label}": places[label] for label in MARKERS}))
    assert clip.states[3, clip.skeleton.index("elbow_left")] == 0
    knee = clip.positions[:, clip.skeleton.index("knee_left")] - SHOWN.joints[:, NODE_INDEX["knee_left"]]
    assert np.linalg.norm(knee, axis=-1).max() < 0.02


def test_a_measured_marker_counts_and_not_where_the_skeletons_model_has_it() -> None:
    places = {
        f"Walker:{label}": place[:, [1, 2, 0]] * 1000.0
        for label, place in plug_in_gait(SHOWN).items()
        if label in MARKERS
    }
    measured = sample.text("Marker", places)
    of_model = sample.text("Bone Marker", {label: place + 20.0 for label, place in places.items()})
    head, *rows = measured.split("\n")
    columns = [row.split(",")[2:] for row in of_model.split("\n")[1:]]
    both = [",".join([row, *more]) if row else row for row, more in zip(rows, columns, strict=True)]
    clip = read("\n".join([head, *both]))
    assert np.array_equal(clip.positions, read(measured).positions)
    alone = read(of_model)
    assert np.abs(alone.positions - clip.positions).max() > 0.01


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            lambda text: text.replace("Length Units,Millimeters", "Length Units,Ells"),
            "expected Length Units of .* 'Ells'",
        ),
        (
            lambda text: text.replace("\nFrame,", "\nPicture,"),
            r"expected a line that begins with Frame, Time",
        ),
        (
            lambda text: text.replace("Bone", "Camera").replace("Marker", "Camera"),
            "expected columns of .* found Camera",
        ),
        (lambda text: text.replace("\n5,0.041667", "\n5,"), "line 13: expected a time in s, found none"),
        (lambda text: text.replace("\n5,0.041667", "\n5,soon"), "line 13: expected a number, found 'soon'"),
        (
            lambda text: text.replace("Coordinate Space,Global", "Coordinate Space,Local"),
            "expected the bones' positions in Coordinate Space Global, found Local: .* export again",
        ),
        (lambda text: text.replace("LThigh", "LXX"), "expected markers from which hips, knees and ankles"),
    ],
)
def test_damage_is_named(change: Callable[[str], str], says: str) -> None:
    with pytest.raises(CaptureError, match=says):
        read(change(TEXT))


def test_published_takes_hold_no_person(sensors: Path) -> None:
    """One has frames and times only, the other 18 unlabelled markers."""
    with pytest.raises(
        CaptureError, match=r"expected columns of a skeleton's bones .* found frames and times only"
    ):
        recognise.read(sensors / "optitrack_motive" / "test_default.csv")
    with pytest.raises(
        CaptureError, match=r"found none for left ASIS.* among Unlabeled 1036, Unlabeled 1037"
    ):
        recognise.read(sensors / "optitrack_motive" / "test_markers_enabled.csv")
