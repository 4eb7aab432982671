"""Qualisys exports, written here from the known walk, and the published files with a marker set."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import marker_csv, source_of
from samples import qualisys_tsv as sample

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise

FRAMES = 30
TEXT = sample.files(FRAMES)["walk.tsv"].decode()
# Of the published files: 5th metatarsal, toe, heel, malleolus, knee, trochanter, shoulder, and the neck.
MARKERS_1 = """
[markers]
foot_left = "New 0008"
ankle_left = "New 0005"
knee_left = "New 0006"
hip_left = "New 0014"
shoulder_left = "New 0011"
foot_right = "New 0015"
ankle_right = "New 0002"
knee_right = "New 0013"
hip_right = "New 0003"
shoulder_right = "New 0007"
"""


def read(text: str) -> Clip:
    return recognise.read_source(source_of(text, Path("walk.tsv")))


def test_the_same_markers_as_in_a_plain_table() -> None:
    clip = read(TEXT)
    content = marker_csv.files(FRAMES)["vicon.csv"].decode()
    same = recognise.read_source(source_of(content, Path("vicon.csv")))
    assert clip.skeleton.names == same.skeleton.names
    assert np.abs(clip.positions - same.positions).max() < 2e-6
    assert np.abs(clip.times - same.times).max() < 1e-9


def test_without_names_of_columns_frames_and_times() -> None:
    plain = sample.text(list(sample.MARKERS), 1000.0 * sample.points(FRAMES), columns=False)
    assert np.array_equal(read(plain).positions, read(TEXT).positions)


def test_null_and_a_decimal_comma_in_the_rate() -> None:
    points = 1000.0 * sample.points(FRAMES)
    points[4, list(sample.MARKERS).index("LKNE")] = np.nan
    for columns in (True, False):
        text = sample.text(list(sample.MARKERS), points, columns=columns)
        head, _, rows = text.partition("FREQUENCY\t100")
        assert "\t\t" in rows
        null = f"{head}FREQUENCY\t100,0{rows}"
        while "\t\t" in null:
            null = null.replace("\t\t", "\tNULL\t")
        assert np.array_equal(read(null).positions, read(text).positions, equal_nan=True)


def test_empty_cells_are_missing_markers() -> None:
    points = 1000.0 * sample.points(FRAMES)
    points[4, list(sample.MARKERS).index("LKNE")] = np.nan
    points[5:] = np.where(np.arange(points.shape[1])[:, None] == points.shape[1] - 1, np.nan, points[5:])
    clip = read(sample.text(list(sample.MARKERS), points))
    knee = clip.states[:, clip.skeleton.index("knee_left")]
    assert knee[4] == 0
    assert np.delete(knee, 4).min() == 2


@pytest.mark.parametrize("columns", [True, False])
def test_the_last_marker_may_be_empty_at_first_and_the_first_one_too(columns: bool) -> None:
    labels = list(sample.MARKERS)
    # A marker of the head is first, one of an arm last.
    points = 1000.0 * sample.points(FRAMES)
    points[0, 0] = points[0, -1] = np.nan
    text = sample.text(labels, points, columns=columns)
    clips = [read(text), read(text.replace("\n", "\t\n"))]
    assert np.array_equal(clips[0].positions, clips[1].positions, equal_nan=True)
    ankle = clips[0].skeleton.index("ankle_left")
    assert np.array_equal(clips[0].positions[:, ankle], read(TEXT).positions[:, ankle])
    assert len(clips[0].times) == FRAMES


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            lambda text: text.replace("FREQUENCY\t100", "FREQUENCY\t-1"),
            "expected a rate in Hz in FREQUENCY, found '-1'",
        ),
        (
            lambda text: text.replace("MARKER_NAMES", "BODY_NAMES"),
            "expected names of markers .* found rigid bodies only",
        ),
        (
            lambda text: text.replace("MARKER_NAMES\tLFHD\t", "MARKER_NAMES\t"),
            r"expected three numbers for each of \d+ markers",
        ),
        (lambda text: text.replace("0.05000\t", "0.05000\tx", 1), "line 17: expected a number, found 'x"),
        (
            lambda text: text[: text.index("\n1\t")],
            "expected three numbers|expected lines of numbers, found none",
        ),
        (
            lambda text: text.replace("LKNE", "A").replace("RANK", "B"),
            r"none for left knee .*; say which marker is where",
        ),
    ],
)
def test_damage_is_named(change: Callable[[str], str], says: str) -> None:
    with pytest.raises(CaptureError, match=says):
        read(change(TEXT))


def test_a_file_that_is_cut_off_at_a_line_says_so() -> None:
    clip = read("\n".join(TEXT.split("\n")[:-6]) + "\n")
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"]) == ("dropped_frames", 5)


def test_published_files(sensors: Path, tmp_path: Path) -> None:
    """Unlabelled markers are refused; a marker set makes them a person who bends and stands up."""
    published = sensors / "qualisys_tsv" / "Measurement1.tsv"
    with pytest.raises(CaptureError, match=r"none for left ASIS.* among New 0000, .*NAME\.markers\.toml"):
        recognise.read(published)
    (tmp_path / "squats.tsv").symlink_to(published)
    (tmp_path / "squats.markers.toml").write_text(MARKERS_1)
    clip = recognise.read(tmp_path / "squats.tsv")
    assert list(clip.provenance["sidecar_files"]) == ["squats.markers.toml"]
    assert len(clip.times) == 2000
    assert clip.rate == pytest.approx(100.0)
    positions = to_nodes(clip)[0]
    for side in ("left", "right"):
        hip, knee, ankle = (positions[:, NODE_INDEX[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle"))
        assert 0.36 < np.median(np.linalg.norm(hip - knee, axis=-1)) < 0.5
        assert 0.36 < np.median(np.linalg.norm(ankle - knee, axis=-1)) < 0.48
    angles = leg_angles(positions)
    for name in ("knee_left", "knee_right"):
        low, high = np.degrees(np.percentile(angles[name], [2, 98]))
        assert low < 20.0
        assert 80.0 < high < 140.0
