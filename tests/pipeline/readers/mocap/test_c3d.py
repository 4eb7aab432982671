"""C3D: joints and markers, omitted units and axes, and damage."""

from __future__ import annotations

import gzip
import importlib.util
import struct
from pathlib import Path

import numpy as np
import pytest
from samples.c3d import big_endian, files, kinect, segments, written
from samples.motion import in_sight, walk
from samples.mutate import mutated
from samples.trc import RATE, markers

from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap import c3d

MARKERS = files(30)["walk.c3d"]


def read(content: bytes) -> Clip:
    return recognise.read_source(Source(Path("walk.c3d"), content, ""))


def rules(clip: Clip) -> list[str]:
    return [defect["rule"] for defect in clip.provenance["reading"]["defects"]]


def assert_is_the_walk(clip: Clip, tolerance: float) -> None:
    positions, _ = to_nodes(clip)
    shown = in_sight(walk(len(clip.times), RATE))
    for node in ("hip", "knee", "ankle", "foot", "shoulder", "elbow"):
        for side in ("left", "right"):
            index = NODE_INDEX[f"{node}_{side}"]
            assert np.abs(positions[:, index] - shown.joints[:, index]).max() < tolerance, node


def test_markers_of_the_known_walk(tmp_path: Path) -> None:
    clip = read(MARKERS)
    assert (clip.provenance["format"], clip.rate) == ("C3D", pytest.approx(RATE))
    assert_is_the_walk(clip, 1e-6)  # the file has single precision
    packed = tmp_path / "walk.c3d.gz"
    packed.write_bytes(gzip.compress(MARKERS))
    assert np.array_equal(recognise.read(packed).positions, clip.positions, equal_nan=True)


def test_joints_of_a_kinect() -> None:
    clip = read(kinect(30))
    shown = in_sight(walk(30, 30.0))
    assert clip.skeleton.names == NODES
    assert np.abs(clip.positions - shown.joints).max() < 1e-6
    # A Kinect v1 does not record at 50 Hz.
    assert clip.rate == pytest.approx(30.0)
    assert clip.provenance["reading"]["assumed_rate"]["declared"] == 50.0
    assert clip.angles is not None
    assert list(clip.angles) == ["knee_left"]
    assert np.abs(clip.angles["knee_left"] - shown.angles["knee_left"]).max() < 1e-6


def test_axes_units_and_points_other_than_markers() -> None:
    places = markers(in_sight(walk(30, RATE)))
    labels = [f"Jim:{label}" for label in places]
    points = np.stack(list(places.values()), axis=1)
    # Y up, X forward, in centimetres, which nobody says.
    turned = 100.0 * points[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    clip = read(written(labels, turned, rate=RATE, Y_SCREEN=["+Y"]))
    assert_is_the_walk(clip, 1e-6)
    assert clip.provenance["reading"]["units"] == "cm"
    assert "size of the body" in clip.provenance["reading"]["units_rule"]
    forces = np.concatenate([1000.0 * points, np.full((30, 1, 3), 7e5)], axis=1)
    assert_is_the_walk(read(written([*labels, "LKneeMoment"], forces, rate=RATE, units="mm")), 1e-6)


@pytest.mark.parametrize(
    ("word", "metres"),
    [
        ("in", 0.0254),
        ("Inches", 0.0254),
        ("ft", 0.3048),
        ("feet", 0.3048),
        ("dm", 0.1),
        ("millimeters", 0.001),
    ],
)
def test_units_by_their_words(word: str, metres: float) -> None:
    places = markers(in_sight(walk(30, RATE)))
    points = np.stack(list(places.values()), axis=1) / metres
    clip = read(written(list(places), points, rate=RATE, units=word, Y_SCREEN=["+Z"]))
    assert_is_the_walk(clip, 1e-5)
    assert clip.provenance["reading"]["units_rule"] == "the file's"
    assert rules(clip) == []


@pytest.mark.parametrize(("units", "times"), [("mm", 1.0), ("m", 1000.0), ("cm", 1.0)])
def test_markers_in_another_unit_than_declared(units: str, times: float) -> None:
    places = markers(in_sight(walk(30, RATE)))
    points = times * np.stack(list(places.values()), axis=1)
    clip = read(written(list(places), points, rate=RATE, units=units, Y_SCREEN=["+Z"]))
    assert_is_the_walk(clip, 1e-6)
    (found,) = clip.provenance["reading"]["defects"]
    assert (found["rule"], found["action"]) == ("wrong_units", "repaired")


def test_points_with_a_negative_residual_are_missing() -> None:
    places = markers(in_sight(walk(30, RATE)))
    points = 1000.0 * np.stack(list(places.values()), axis=1)
    points[7, list(places).index("L.Knee.Lat")] = np.nan
    clip = read(written(list(places), points, rate=RATE, units="mm"))
    missing = {(int(t), clip.skeleton.names[j]) for t, j in zip(*np.nonzero(clip.states == 0), strict=True)}
    assert missing == {(7, "knee_left")}


def with_rate(content: bytes, rate: float) -> bytes:
    """The file with another POINT:RATE; ezc3d itself does not write impossible ones."""
    name = content.index(b"RATE", 512) + len(
        b"RATE"
    )  # then: offset to the next, type, dimensions, the number
    assert content[name + 2] == 4
    at = name + 4 + content[name + 3]
    told = struct.pack("<f", rate)
    return content[:20] + told + content[24:at] + told + content[at + 4 :]


def test_unreadable_files_are_reported() -> None:
    places = markers(in_sight(walk(30, RATE)))
    points = np.stack(list(places.values()), axis=1)
    with pytest.raises(CaptureError, match=r"expected POINT:UNITS of m, cm, mm, or .* found '' and a body"):
        read(written(list(places), 1e-3 * points, rate=RATE))
    with pytest.raises(CaptureError, match="expected a rate in Hz in POINT:RATE, found -1"):
        read(with_rate(written(list(places), points, rate=RATE, units="m"), -1.0))
    with pytest.raises(CaptureError, match=r"found none for left ASIS; right ASIS; .* among A, B"):
        read(written(["A", "B"], points[:, :2], rate=RATE, units="m"))


def test_the_refusal_lists_the_labels_of_the_file() -> None:
    places = markers(in_sight(walk(30, RATE)))
    labels = [label.replace("Knee", "Pocket") for label in places]
    points = np.stack(list(places.values()), axis=1)
    with pytest.raises(CaptureError, match=r"found none for left knee .* among .*L\.Pocket\.Lat"):
        read(written(labels, points, rate=RATE, units="m"))


def test_outputs_of_a_model_are_no_places() -> None:
    places = markers(in_sight(walk(30, RATE)))
    points = np.stack(list(places.values()), axis=1)
    outputs = ["LHipAngles", "LKneeAngles", "LAnkleAngles", "LKneeMoment", "LAnklePower"]
    numbers = np.random.default_rng(1).normal(0.0, 30.0, (30, len(outputs), 3))
    alone = read(written(list(places), points, rate=RATE, units="m"))
    both = read(written([*places, *outputs], np.hstack([points, numbers]), rate=RATE, units="m"))
    np.testing.assert_allclose(both.positions, alone.positions, atol=1e-6)
    with pytest.raises(CaptureError, match=r"found outputs of a model alone .*; export"):
        read(written(outputs, numbers, rate=RATE, units="m"))


def test_computed_joint_centres_are_the_legs() -> None:
    """With the markers of the pelvis, or alone."""
    shown = in_sight(walk(30, RATE))
    places = {
        f"Jim_{side[0].upper()}{joint[0].upper()}JC": shown.joints[:, NODE_INDEX[f"{joint}_{side}"]]
        for side in ("left", "right")
        for joint in ("hip", "knee", "ankle", "shoulder")
    }
    for more in ({}, {f"Jim_{label}": at for label, at in markers(shown).items() if "Knee" not in label}):
        labelled = {**places, **more}
        points = np.stack(list(labelled.values()), axis=1)
        clip = read(written(list(labelled), points, rate=RATE, units="Meters"))
        assert clip.provenance["reading"]["units"] == "m"
        assert ("spine" in clip.skeleton.names) == bool(more)
        positions, _ = to_nodes(clip)
        for node in ("hip_left", "knee_right", "ankle_left", "shoulder_right"):
            assert np.abs(positions[:, NODE_INDEX[node]] - shown.joints[:, NODE_INDEX[node]]).max() < 1e-6


def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(KinemimicError, match=r"pip install 'kinemimic\[c3d\]'"):
        read(MARKERS)


def test_a_truncated_file_is_reported() -> None:
    with pytest.raises(
        CaptureError, match="expected 30 frames of 22 points, as in the header, found room for"
    ):
        read(MARKERS[: len(MARKERS) - 4096])
    with pytest.raises(CaptureError, match="cut off"):
        read(MARKERS[:1500])


def test_input_that_crashes_the_library_is_an_error() -> None:
    # A parameter of a group that is not there: ezc3d ends with a segmentation fault.
    group = MARKERS.index(b"FRAMES", 512) - 1
    with pytest.raises(CaptureError, match="expected a whole C3D file, found damage on which ezc3d fails"):
        read(MARKERS[:group] + bytes([171]) + MARKERS[group + 1 :])


def test_damage_is_an_error_or_a_clip() -> None:
    rng = np.random.default_rng(2026)
    errors = 0
    for _ in range(40):
        content = mutated(MARKERS, rng)
        if not content.strip():
            continue
        try:
            clip = read(content)
        except KinemimicError as error:
            errors += 1
            assert len(str(error).splitlines()) == 1
        else:
            assert np.isfinite(clip.positions[clip.states > 0]).all()
    assert errors > 5


def test_the_treadmills_c3d_is_its_ascii(captures: Path) -> None:
    folder = captures / "kinect1_treadmill_c3d"
    binary, text = (recognise.read(folder / f"skeleton_3d_19h58m42.{kind}") for kind in ("c3d", "txt"))
    assert np.array_equal(binary.states, text.states)
    assert np.array_equal(binary.times, text.times)
    assert np.nanmax(np.abs(binary.positions - text.positions)) < 1e-5
    assert binary.angles is not None
    assert text.angles is not None
    assert binary.angles.keys() == text.angles.keys()
    for name, curve in binary.angles.items():
        assert np.nanmax(np.abs(curve - text.angles[name])) < 1e-5, name
    assert rules(binary) == rules(text)


def test_the_other_take_of_the_treadmill(captures: Path) -> None:
    clip = recognise.read(captures / "kinect1_treadmill_c3d" / "skeleton_3d_19h49m16.c3d")
    assert len(clip.times) == 391
    assert clip.provenance["reading"]["assumed_rate"]["declared"] == 50.0


def test_frames_beyond_what_the_header_counts_are_reported() -> None:
    points = np.zeros((70_000, 1, 3))
    long = Source(Path("long.c3d"), written(["A"], points, rate=RATE), "")
    (defect,) = c3d.unread_frames(long, 65535)
    assert (defect.rule, defect.action) == ("dropped_frames", "flagged")
    assert abs(defect.count - (70_000 - 65535)) < 512 / 16  # the last block is padded
    assert c3d.unread_frames(long, 70_000) == []
    assert c3d.unread_frames(Source(Path("walk.c3d"), MARKERS, ""), 30) == []


def test_a_file_of_a_big_endian_computer_is_the_same() -> None:
    assert np.array_equal(read(big_endian(MARKERS)).positions, read(MARKERS).positions, equal_nan=True)
    damaged = bytearray(big_endian(MARKERS))
    damaged[damaged.index(b"LABELS") + 8] = 99  # the type of its values
    with pytest.raises(CaptureError, match="expected parameters of a C3D file, found damage"):
        read(bytes(damaged))


def test_origins_of_segments_are_the_joints() -> None:
    clip = read(segments(30))
    assert_is_the_walk(clip, 1e-6)
    assert clip.rate == pytest.approx(RATE)


def test_a_file_without_a_rate_is_read_at_100_hz() -> None:
    clip = read(with_rate(MARKERS, 0.0))
    assert clip.rate == pytest.approx(100.0)
    assert rules(clip) == ["wrong_rate"]
