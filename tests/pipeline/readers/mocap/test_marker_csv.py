"""Tables of markers without times, written here from a known motion, and a published one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import marker_csv as sample
from samples import source_of
from samples.motion import in_sight, walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.mocap.marker_csv import RATE

FRAMES = 40
TAKE = sample.files(FRAMES)["vicon.csv"].decode()
LINES = TAKE.strip().split("\n")


def read(text: str) -> Clip:
    return recognise.read_source(source_of(text, Path("vicon.csv")))


def test_the_known_walk_comes_back() -> None:
    shown, clip = in_sight(walk(FRAMES, RATE)), read(TAKE)
    assert clip.provenance["format"] == "Marker CSV"
    assert clip.rate == pytest.approx(RATE)
    assert "no time in the file: 100 Hz" in clip.provenance["reading"]["notes"][0]
    positions, _ = to_nodes(clip)
    for node in ("hip_left", "knee_right", "ankle_left", "shoulder_right", "foot_left"):
        assert np.abs(positions[:, NODE_INDEX[node]] - shown.joints[:, NODE_INDEX[node]]).max() < 1e-6, node
    for name, curve in leg_angles(positions).items():
        assert np.abs(curve - shown.angles[name]).max() < 1e-5, name


def test_commas_and_columns_in_another_sequence() -> None:
    swapped = "\n".join(",".join(reversed(line.split(";"))) for line in LINES)
    assert np.array_equal(read(swapped).positions, read(TAKE).positions)


def test_empty_cells_are_missing_markers() -> None:
    cells = LINES[5].split(";")
    at = LINES[0].split(";").index("LKNE (x)")
    cells[at : at + 3] = ["", "", ""]
    clip = read("\n".join([*LINES[:5], ";".join(cells), *LINES[6:]]))
    knee = clip.skeleton.names.index("knee_left")
    assert np.flatnonzero(clip.states[:, knee] == 0).tolist() == [4]


def test_metres_in_place_of_millimetres_are_found() -> None:
    rows = [";".join(f"{float(cell) / 1000.0:.7f}" for cell in line.split(";")) for line in LINES[1:]]
    clip = read("\n".join([LINES[0], *rows]))
    assert np.abs(clip.positions - read(TAKE).positions).max() < 1e-6
    assert [defect["rule"] for defect in clip.provenance["reading"]["defects"]] == ["wrong_units"]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda text: text.replace("LKNE (y)", "LKNE (q)"), r"line 1: expected columns NAME .*'LKNE \(q\)'"),
        (lambda text: text.replace("LKNE (y)", "LKNE (x)"), r"line 1: .*'LKNE \(x\)' twice"),
        (lambda text: text.replace("LKNE (y)", "LKNO (y)"), r"no column LKNE \(y\)"),
        (lambda text: text.replace("LKNE", "KNOB").replace("LANK", "BONK"), "none for left knee"),
        (lambda text: text.replace(LINES[4].split(";")[3], "oops", 1), "expected a number, found 'oops'"),
        (lambda text: text.replace(LINES[4].split(";")[3], "1e9", 1), "expected at most 100"),
        (lambda text: text[: len(text) - 100], "expected 117 numbers, found .*the file is cut off"),
        (lambda _: LINES[0], "line 2: expected lines of numbers, found none"),
    ],
)
def test_damage(change: Callable[[str], str], says: str) -> None:
    with pytest.raises(CaptureError, match=says):
        read(change(TAKE))


def test_the_published_table(captures: Path) -> None:
    path = captures.parent / "sensors" / "azure_kinect_vicon" / "vicon.csv"
    if not path.is_file():
        pytest.skip("no published table of markers beside the captures")
    clip = recognise.read(path)
    assert len(clip.times) == 2700
    # A walk on a treadmill from 8 s on, at the assumed rate with strides of a human length.
    knee = np.degrees(leg_angles(to_nodes(clip)[0])["knee_left"])[800:]
    assert 50.0 < knee.max() < 80.0
    assert -5.0 < knee.min() < 20.0
    bends = np.flatnonzero((knee[:-1] < 40.0) & (knee[1:] >= 40.0)) / RATE
    assert 0.9 < np.median(np.diff(bends)) < 1.4
