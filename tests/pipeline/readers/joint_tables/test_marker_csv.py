"""Tables of markers in any spelling, written here from a known motion, and a published one."""

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
from kinemimic.pipeline.readers.joint_tables.marker_csv import RATE

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
    assert clip.provenance["reading"]["units"] == "m"


ROWS = [line.split(";") for line in LINES[1:]]
LABELS = [name.removesuffix(" (x)") for name in LINES[0].split(";")[::3]]


def spelt(name: str) -> str:
    """A header and rows with times before the markers."""
    names = [name.format(label=label, axis=axis) for label in LABELS for axis in "XYZ"]
    rows = [",".join([f"{k / RATE:.3f}", *row]) for k, row in enumerate(ROWS)]
    return "\n".join([",".join(["Time", *names]), *rows])


def above() -> str:
    """Labels above the axes, units below, and frame numbers."""
    head = [",," + ",".join(f"Jim:{label},," for label in LABELS), "Frame,Sub Frame" + ",X,Y,Z" * len(LABELS)]
    rows = [",".join([f"{k + 7}", "0", *row]) for k, row in enumerate(ROWS)]
    return "\n".join([*head, ",," + ",mm" * 3 * len(LABELS), *rows]).replace(",,,mm", ",,mm")


SPELLINGS = (
    "{label}_{axis}",
    "{label}.pos.{axis}",
    "Jim:{label} {axis} (mm)",
    "{axis}_{label}",
    "{label}{axis}",
)


@pytest.mark.parametrize(
    "text",
    [
        *map(spelt, SPELLINGS),
        above(),
        spelt("{label}_{axis}").replace(",", "\t"),
        spelt("{label}_{axis}").replace(",", ";").replace(".", ","),
    ],
)
def test_other_spellings(text: str) -> None:
    clip = read(text)
    assert clip.provenance["format"] == "Marker CSV"
    assert np.abs(clip.positions - read(TAKE).positions).max() < 1e-6
    assert clip.times - clip.times[0] == pytest.approx(np.arange(FRAMES) / RATE)


def test_y_up() -> None:
    rows = [";".join(np.reshape(row, (-1, 3))[:, [1, 2, 0]].ravel()) for row in ROWS]
    clip = read("\n".join([LINES[0], *rows]))
    for name, curve in leg_angles(to_nodes(clip)[0]).items():
        assert np.abs(curve - leg_angles(to_nodes(read(TAKE))[0])[name]).max() < 1e-5, name
    assert "Y points up" in clip.provenance["reading"]["notes"][1]


def test_labels_of_a_marker_set(tmp_path: Path) -> None:
    named = {"LASI": "a1", "RASI": "a2", "LPSI": "a3", "RPSI": "a4"}
    text = spelt("{label}_{axis}")
    for label, other in named.items():
        text = text.replace(label, other)
    (tmp_path / "walk.csv").write_text(text)
    with pytest.raises(CaptureError, match="unknown header"):
        recognise.read(tmp_path / "walk.csv")
    legs = {f"{joint}_lateral_{side}": f"{side[0].upper()}{label}" for side in ("left", "right")
            for joint, label in (("knee", "KNE"), ("ankle", "ANK"))}  # fmt: skip
    legs |= {"asis_left": "a1", "asis_right": "a2", "psis_left": "a3", "psis_right": "a4"}
    lines = [f'{landmark} = "{label}"' for landmark, label in legs.items()]
    (tmp_path / "walk.markers.toml").write_text("\n".join(["[markers]", *lines]))
    clip = recognise.read(tmp_path / "walk.csv")
    knee = clip.skeleton.index("knee_left")
    assert (
        np.abs(
            clip.positions[:, knee] - read(TAKE).positions[:, read(TAKE).skeleton.index("knee_left")]
        ).max()
        < 1e-6
    )


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda text: text.replace("LKNE (y)", "LKNE (q)"), "none for left knee"),
        (lambda text: text.replace("LKNE", "KNOB").replace("LANK", "BONK"), "none for left knee"),
        (
            lambda text: text.replace(LINES[4].split(";")[3], "oops", 1),
            "expected a number in .*, found 'oops'",
        ),
        (lambda text: text.replace(LINES[4].split(";")[3], "1e9", 1), "expected at most 100"),
        (lambda text: text[: len(text) - 100], "expected 117 columns, found .*the file is cut off"),
        (lambda _: LINES[0], "text that begins"),
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


def test_markers_that_are_never_seen(recwarn: pytest.WarningsRecorder) -> None:
    nothing = ";".join(["0"] * len(LINES[0].split(";")))
    with pytest.raises(CaptureError, match="expected markers from which hips, knees and ankles"):
        read("\n".join([LINES[0], *[nothing] * FRAMES]))
    assert not list(recwarn)
