"""OpenSim's tables of markers, written here from the known walk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import source_of, trc
from samples import sto_markers as sample

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers import recognise

FRAMES = 30
PLACES, TIMES = sample.places(FRAMES)
TEXTS = {name: content.decode() for name, content in sample.files(FRAMES).items()}


def read(content: str) -> Clip:
    return recognise.read_source(source_of(content, Path("walk.sto")))


@pytest.mark.parametrize("name", TEXTS)
def test_the_clip_is_that_of_the_same_markers_in_a_trc(name: str) -> None:
    expected = recognise.read_source(source_of(trc.files(FRAMES)["walk.trc"].decode(), Path("walk.trc")))
    clip = read(TEXTS[name])
    assert clip.provenance["format"] == "OpenSim .sto of markers"
    assert clip.skeleton.names == expected.skeleton.names
    assert np.abs(clip.positions - expected.positions).max() < 1e-7
    assert np.abs(clip.times - expected.times).max() < 1e-9


@pytest.mark.parametrize("vectors", [False, True])
def test_a_marker_may_be_missing_and_the_unit_another(vectors: bool) -> None:
    shown = {label: 1000.0 * place for label, place in PLACES.items()}
    shown["R.Toe.Tip"][6] = np.nan
    clip = read(sample.text(shown, TIMES, vectors=vectors, units="mm"))
    assert np.argwhere(clip.states == 0).tolist() == [[6, clip.skeleton.index("foot_right")]]
    assert clip.provenance["reading"]["units"] == "mm"
    assert np.nanmax(np.abs(clip.positions - read(TEXTS["markers.sto"]).positions)) < 1e-6


def test_other_columns_may_stand_beside_the_markers() -> None:
    lines = TEXTS["model_marker_locations.sto"].split("\n")
    names = next(k for k, line in enumerate(lines) if line.startswith("time"))
    lines[names] += "\ttotal_error"
    lines[names + 1 :] = [line + "\t0.01" if line else "" for line in lines[names + 1 :]]
    assert np.array_equal(
        read("\n".join(lines)).positions, read(TEXTS["model_marker_locations.sto"]).positions
    )


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("markers.sto", "\n0.05000\t", "\n0.05000\tsoon,", "line 12: expected 67 numbers, found 68"),
        ("markers.sto", "\n0.05000\t", "\nnan\t", "line 12: expected a time in s, found nan"),
        ("markers.sto", "\ntime\t", "\nframe\t", "line 6: expected time as the first column, found 'frame'"),
        ("model_marker_locations.sto", "ASIS_", "XX_", "expected markers from which hips, knees and ankles"),
    ],
)
def test_damage_is_named(name: str, old: str, new: str, message: str) -> None:
    with pytest.raises(CaptureError, match=message):
        read(TEXTS[name].replace(old, new))


def test_a_table_that_is_cut_off_is_flagged() -> None:
    clip = read(TEXTS["markers.sto"].replace(f"nRows={FRAMES}", f"nRows={FRAMES + 5}"))
    (found,) = clip.provenance["reading"]["defects"]
    assert (found["rule"], found["count"], found["action"]) == ("dropped_frames", 5, "flagged")
