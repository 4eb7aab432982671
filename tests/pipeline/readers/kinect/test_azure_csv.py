"""Azure Kinect CSV, written here from the recording of the JSON sample, and the published pair."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import azure_csv as sample
from samples import azure_kinect as json_sample
from samples import source_of

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.kinect import azure_csv

FRAMES = 30
LOST = [5, 6, 7]
POSITIONS, ORIENTATIONS = (content.decode() for content in sample.files(FRAMES).values())
NAMES = tuple(sample.files(FRAMES))


def put(folder: Path, positions: str | None = POSITIONS, orientations: str | None = ORIENTATIONS) -> Path:
    """The pair in a folder; None for a file that is not there."""
    for name, text in zip(NAMES, (positions, orientations), strict=True):
        if text is not None:
            (folder / name).write_text(text)
    return folder / NAMES[0]


def test_the_recording_is_that_of_the_json(tmp_path: Path) -> None:
    clip = recognise.read(put(tmp_path))
    content = json_sample.files(FRAMES)["walk.json"].decode()
    same = recognise.read_source(source_of(content, Path("walk.json")))
    assert clip.provenance["format"] == azure_csv.FORMAT.name
    # The person is not seen in three frames of the JSON; the tables have no row for an empty frame.
    seen = np.delete(np.arange(FRAMES), LOST)
    assert np.abs(clip.times - same.times[seen]).max() < 1e-9
    assert np.abs(clip.positions - same.positions[seen]).max() < 1e-5
    assert clip.rotations is not None
    assert same.rotations is not None
    assert np.abs(clip.rotations - same.rotations[seen]).max() < 1e-6
    assert clip.states.min() == 2


def test_either_file_may_be_passed(tmp_path: Path) -> None:
    first = recognise.read(put(tmp_path))
    second = recognise.read(tmp_path / NAMES[1])
    assert np.array_equal(first.positions, second.positions, equal_nan=True)
    assert list(second.provenance["sidecar_files"]) == [NAMES[0]]


def test_positions_alone_are_a_capture(tmp_path: Path) -> None:
    clip = recognise.read(put(tmp_path, orientations=None))
    assert clip.rotations is None
    assert "no file of orientations" in " ".join(clip.provenance["reading"]["notes"])
    assert "knee_left" in NODE_INDEX
    assert np.isfinite(to_nodes(clip)[0]).all()


def test_orientations_alone_name_the_missing_file(tmp_path: Path) -> None:
    put(tmp_path, positions=None)
    with pytest.raises(CaptureError, match=r"expected azure_positions\.csv with the positions"):
        recognise.read(tmp_path / NAMES[1])


def test_the_bystander_is_dropped_and_counted(tmp_path: Path) -> None:
    (defect,) = recognise.read(put(tmp_path)).provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"], defect["action"]) == ("several_people", 1, "repaired")
    assert "1 more in 10 frames" in defect["text"]


def test_confidence_is_the_state(tmp_path: Path) -> None:
    rows = POSITIONS.split("\n")
    cells = rows[1].split(";")
    cells[2], cells[6], cells[10] = "0", "1", "3"
    clip = recognise.read(put(tmp_path, "\n".join([rows[0], ";".join(cells), *rows[2:]])))
    assert clip.states[0, :4].tolist() == [0, 1, 2, 2]
    assert np.isnan(clip.positions[0, 0]).all()


def test_commas_and_the_old_spelling(tmp_path: Path) -> None:
    plain = recognise.read(put(tmp_path))
    other = [text.replace(";", ",").replace("NAVEL", "NAVAL") for text in (POSITIONS, ORIENTATIONS)]
    clip = recognise.read(put(tmp_path, *other))
    assert np.array_equal(clip.positions, plain.positions, equal_nan=True)


def cell(row: int, column: int, value: str) -> Callable[[str], str]:
    """Replaces a cell; row 0 is the header."""

    def change(text: str) -> str:
        rows = text.split("\n")
        cells = rows[row].split(";")
        cells[column] = value
        return "\n".join([*rows[:row], ";".join(cells), *rows[row + 1 :]])

    return change


@pytest.mark.parametrize(
    ("half", "change", "says"),
    [
        (0, cell(0, 6, "TAIL (c)"), r"line 1: expected the positions .* no column SPINE_NAVEL \(c\)"),
        (0, cell(0, 6, "PELVIS (c)"), r"line 1: expected column names once each, found 'PELVIS \(c\)' twice"),
        (0, cell(3, 0, "nan"), "line 4: expected a timestamp in µs, found nan"),
        (0, cell(3, 0, "-5"), "line 4: expected a timestamp in µs, found -5"),
        (0, cell(3, 1, "0.5"), "line 4: expected a whole number as body_idx, found 0.5"),
        (0, cell(3, 2, "7"), "line 4: expected a confidence of PELVIS, 0 to 3, found 7"),
        (0, cell(3, 3, "oops"), "line 4: expected a number, found 'oops'"),
        (0, cell(3, 3, "1e9"), "line 4: expected at most 100000 mm in X of PELVIS, found 1e\\+09"),
        (0, lambda text: text[: len(text) - 40], "expected 130 numbers, found .*cut off"),
        (0, lambda text: text.split("\n")[0], "line 2: expected lines of numbers, found none"),
        (
            0,
            lambda text: "\n".join([*text.split("\n")[:4], *text.split("\n")[3:]]),
            "expected as many rows as",
        ),
        (1, cell(3, 2, "9"), "azure_orientations.csv, line 4: expected a unit quaternion of PELVIS"),
        (1, cell(3, 1, "4"), "azure_orientations.csv, line 4: expected body 3 at"),
        (1, lambda _: POSITIONS, r"azure_orientations.csv: expected columns PELVIS \(w\)"),
        (
            1,
            lambda text: "\n".join(text.split("\n")[:-2]),
            "azure_orientations.csv: expected as many rows as",
        ),
    ],
)
def test_damage(half: int, change: Callable[[str], str], says: str, tmp_path: Path) -> None:
    texts = [POSITIONS, ORIENTATIONS]
    texts[half] = change(texts[half])
    with pytest.raises(CaptureError, match=says):
        recognise.read(put(tmp_path, *texts))


def test_the_same_body_twice_in_a_frame(tmp_path: Path) -> None:
    twice = "\n".join([*POSITIONS.split("\n")[:4], *POSITIONS.split("\n")[3:]])
    with pytest.raises(CaptureError, match="line 5: expected one row for each body of a frame"):
        recognise.read(put(tmp_path, twice, None))


def test_the_published_pair(captures: Path) -> None:
    folder = captures.parent / "sensors" / "azure_kinect_vicon"
    if not folder.is_dir():
        pytest.skip("no recording of an Azure Kinect beside the captures")
    clip = recognise.read(folder / "azure_positions.csv")
    assert clip.positions.shape == (1105, 32, 3)
    assert clip.rate == pytest.approx(30.0, abs=0.01)
    nodes, _ = to_nodes(clip)
    for side in ("left", "right"):
        hip, knee, ankle = (nodes[:, NODE_INDEX[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle"))
        assert 0.35 < np.median(np.linalg.norm(knee - hip, axis=-1)) < 0.5
        assert 0.33 < np.median(np.linalg.norm(ankle - knee, axis=-1)) < 0.45
