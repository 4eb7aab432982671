"""The catalogue that ships: complete, and true of the recordings where they are at hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples.corpus import published

from kinemimic.pipeline.catalog.entry import Collection, Entry
from kinemimic.pipeline.catalog.load import CATALOG, load_catalog
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.store import file_hash
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.recognise import formats, reader_of
from kinemimic.pipeline.readers.video.container import FORMAT as VIDEO
from kinemimic.pipeline.readers.video.container import is_video
from kinemimic.pipeline.video.decode import frames

ENTRIES = load_catalog().entries
COLLECTIONS = load_catalog().collections
# Beside the recordings, of whoever keeps them; the last is made from fda_gait.rda.
NOTES = {"MANIFEST.tsv", "README.md", "SOURCE.txt", "fda_gait_derived.csv"}
# Clocks that are irregular (frames of the middle step say nothing of the rate), cycles without a clock, and
# files that read as nothing: a skeleton alone, damaged exports.
WITHOUT_RATE = {
    *(entry.name for entry in ENTRIES if entry.collection == "kinect1_utkinect"),
    "kinect2_khokhlova_orient/JointsInfo_before_CHU_test.txt",
    "lab_opensim_gait/Intro_to_Musculoskeletal_Modeling__crouch1.mot",
    "lab_opensim_gait/Intro_to_Musculoskeletal_Modeling__normal.mot",
    "cmu_asfamc/02.asf",
    *(entry.name for entry in ENTRIES if entry.collection == "kinect2_kinect2bvh"),
    # Image landmarks, and markers without names or of an arm: refused with the reason.
    "mediapipe_csv/Ash1708_pose_landmarks.csv",
    "mediapipe_csv/korok-leaf_pose_landmarks.csv",
    *(entry.name for entry in ENTRIES if entry.collection in ("qualisys_tsv", "optitrack_motive")),
    "vicon_csv/markers.csv",
}


@pytest.mark.parametrize("collection", COLLECTIONS, ids=lambda collection: collection.name)
def test_formats_are_known_files_sorted_and_texts_without_full_stop(collection: Collection) -> None:
    known = {format.name for format in formats()}
    assert {entry.format for entry in collection.entries} <= known | {None}
    assert collection.format in known
    named = [entry.file for entry in collection.entries]
    assert named == sorted(named)
    for text in (collection.title, collection.sensor, collection.shows, collection.citation):
        assert text == text.strip()
        assert text.endswith("al.") or not text.endswith(".")


def test_nothing_is_there_twice() -> None:
    assert len({entry.url for entry in ENTRIES}) == len(ENTRIES)
    assert len({entry.sha256 for entry in ENTRIES}) == len(ENTRIES)


def test_every_file_has_a_line() -> None:
    """So that a change of one is seen as such."""
    lines = CATALOG.read_text(encoding="utf-8").splitlines()
    assert sum(line.startswith("  { name = ") and line.endswith(" },") for line in lines) == len(ENTRIES)


def test_every_address_is_quoted() -> None:
    assert all(" " not in entry.url for entry in ENTRIES)
    (r2,) = (entry for entry in ENTRIES if entry.name == "kinect1_bernstein_skl/r2.skl")
    assert r2.url == (
        "https://raw.githubusercontent.com/ranBernstein/GaitKinect/6402092e8366f6ad507580388f2328d877202df8/"
        "Fourier/inputs/Kinect%20from%20ME/r2.skl"
    )


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.name)
def test_the_file_is_the_one_that_is_meant(entry: Entry, captures: Path) -> None:
    path = published(captures, entry.name)
    assert path.stat().st_size == entry.bytes
    assert file_hash(path) == entry.sha256
    assert _format(path) == entry.format


def test_every_recording_at_hand_is_in_it(captures: Path) -> None:
    there = {
        path.relative_to(captures).as_posix()
        for path in captures.rglob("*")
        if path.is_file() and path.name not in NOTES and not path.name.startswith(".")
    }
    beside = captures.parent / "sensors"
    there |= {
        path.relative_to(beside).as_posix().replace("/", "__").replace("__", "/", 1)
        for path in beside.rglob("*")
        if path.is_file() and path.name not in NOTES
    }
    assert there == {entry.name for entry in ENTRIES}


@pytest.mark.slow
@pytest.mark.parametrize("entry", [e for e in ENTRIES if e.format], ids=lambda entry: entry.name)
def test_the_frame_rate_is_what_our_readers_find(entry: Entry, captures: Path) -> None:
    assert (entry.frame_rate is None) == (entry.name in WITHOUT_RATE)
    if entry.frame_rate is not None:
        path = published(captures, entry.name)
        assert _rate(path) == pytest.approx(entry.frame_rate, rel=2e-3)


def _rate(path: Path) -> float:
    if is_video(path):
        # By its own clock: neither landmarks nor the extra are needed.
        return 1.0 / float(np.median(np.diff([frame.time for frame in frames(path)])))
    source = Source.open(path)
    return reader_of(source).read(source).rate


def _format(path: Path) -> str | None:
    if is_video(path):
        return VIDEO.name
    try:
        return reader_of(Source.open(path)).FORMAT.name
    except CaptureError:
        return None
