"""MAT-files of QTM and the MoCap Toolbox, written by scipy from the known walk."""

from __future__ import annotations

import hashlib
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples import matlab_markers as sample
from samples import qualisys_skeleton, qualisys_tsv, source_of
from samples.motion import walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.array_files import mat5
from kinemimic.pipeline.readers.base.source import Source

FRAMES = 30
PLACES = 1000.0 * sample.points(FRAMES)
LABELS = list(sample.MARKERS)


def read(content: bytes) -> Clip:
    return recognise.read_source(Source(Path("walk.mat"), content, hashlib.sha256(content).hexdigest()))


def same_as_tsv(clip: Clip, places: np.ndarray = PLACES) -> None:
    text = qualisys_tsv.text(LABELS, places)
    same = recognise.read_source(source_of(text, Path("walk.tsv")))
    assert clip.skeleton.names == same.skeleton.names
    np.testing.assert_allclose(clip.positions, same.positions, atol=2e-6)
    np.testing.assert_allclose(clip.times, same.times, atol=1e-9)


@pytest.mark.parametrize("compressed", [True, False])
def test_the_same_markers_as_in_tsv(compressed: bool) -> None:
    clip = read(sample.saved(walk=sample.qtm(LABELS, PLACES), compressed=compressed))
    assert clip.provenance["format"] == "markers in a MAT-file"
    same_as_tsv(clip)


@pytest.mark.parametrize("compressed", [True, False])
def test_the_mocap_toolbox(compressed: bool) -> None:
    same_as_tsv(read(sample.saved(d=sample.toolbox(LABELS, PLACES), compressed=compressed)))


def test_markers_that_are_hidden_for_a_while() -> None:
    places = PLACES.copy()
    places[4:9, [LABELS.index("LANK"), LABELS.index("RSHO")]] = np.nan
    same_as_tsv(read(sample.saved(walk=sample.qtm(LABELS, places))), places)


def by_name(scale: float = 1.0, width: int = 3) -> dict[str, np.ndarray]:
    padded = np.concatenate([PLACES, np.ones((FRAMES, len(LABELS), 1))], axis=-1)[..., :width]
    return {label: scale * padded[:, k] for k, label in enumerate(LABELS)}


def test_a_variable_for_each_marker_and_their_rate() -> None:
    clip = read(sample.saved(**by_name(), fs=sample.RATE))
    same_as_tsv(clip)
    assert "no time in the file: 100 Hz (fs)" in clip.provenance["reading"]["notes"]


def test_a_cell_for_each_signal_as_of_visual3d_in_metres() -> None:
    signals = {label: cell(value) for label, value in by_name(1e-3).items()}
    angles = cell(np.zeros((FRAMES, 3)))
    clip = read(sample.saved(FRAME_RATE=cell(np.array([[sample.RATE]])), L_HIP_ANGLE=angles, **signals))
    same_as_tsv(clip)
    assert clip.provenance["reading"]["units"] == "m"
    assert not clip.provenance["reading"]["defects"]


def test_a_structure_of_markers_without_a_rate() -> None:
    clip = read(sample.saved(markers=by_name(width=4), gait={"side": "L"}))
    assert clip.rate == pytest.approx(100.0)
    assert any("no time in the file: 100 Hz, unless" in note for note in clip.provenance["reading"]["notes"])


ANGLES = {
    f"{side}{joint}Angles": np.full((FRAMES, 3), 20.0) for side in "LR" for joint in ("Hip", "Knee", "Ankle")
}


@pytest.mark.parametrize("order", ["TMX", "TXM", "MXT", "XMT", "MTX", "XTM", "T(MX)", "(MX)T"])
@pytest.mark.parametrize("structure", [False, True])
def test_names_beside_a_matrix(order: str, structure: bool) -> None:
    rows = PLACES.reshape(FRAMES, -1)
    flat = {"T(MX)": rows, "(MX)T": rows.T}
    matrix = flat[order] if order in flat else PLACES.transpose(["TMX".index(axis) for axis in order])
    velocities = np.gradient(matrix, axis=0)
    both = {"velocities": velocities, "traj": matrix, "labels": sample.cells(LABELS), "fs": 0.5 * sample.RATE}
    clip = read(sample.saved(**({"trial": both} if structure else both)))
    assert clip.provenance["format"] == "markers in a MAT-file"
    same_as_tsv(replace(clip, times=0.5 * clip.times))


def test_orientations_beside_the_matrix_and_names_that_are_empty_or_doubled() -> None:
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (FRAMES, len(LABELS) + 3, 1))
    places = np.concatenate([PLACES, np.ones((FRAMES, 3, 3))], axis=1)
    names = sample.cells([*LABELS, "", "", LABELS[0]])
    trial = {"labels": names, "orientation": turns, "axes": turns[..., :3], "position": places}
    same_as_tsv(read(sample.saved(trial=trial)))


def test_other_names_and_structures_do_not_matter() -> None:
    deep: Any = 1.0
    for _ in range(30):
        deep = {"a": deep}
    same_as_tsv(read(sample.saved(name="walk 1", labels=sample.cells(LABELS), traj=PLACES, deep=deep)))


def test_names_that_no_matrix_has_are_no_capture() -> None:
    with pytest.raises(CaptureError, match="expected a capture"):
        read(sample.saved(labels=sample.cells(LABELS), emg=np.ones((FRAMES, 7))))


def test_angles_forces_and_other_devices_beside_the_markers() -> None:
    """btk saves its structures in the order of the alphabet, and analogsInfo is before markersInfo."""
    forces = {"FP1": np.full((FRAMES, 3), 800.0), "LKneeMoment": np.full((FRAMES, 3), 3e5)}
    clip = read(
        sample.saved(
            analogsInfo={"frequency": 1000.0}, angles=ANGLES, emg={"fs": 2000.0},
            markers={**by_name(), **forces, **ANGLES}, markersInfo={"frequency": sample.RATE},
        )
    )  # fmt: skip
    same_as_tsv(clip)
    assert "markers of markers" in clip.provenance["reading"]["notes"]


@pytest.mark.parametrize("times", [np.arange(FRAMES) / 50.0, np.arange(FRAMES)[:, None] / 50.0])
def test_the_times_beside_the_markers(times: np.ndarray) -> None:
    assert read(sample.saved(markers=by_name(), time=times)).rate == pytest.approx(50.0)


def test_times_that_do_not_run_forward_are_a_defect() -> None:
    times = np.arange(FRAMES) / 50.0
    times[7] = times[6]
    clip = read(sample.saved(markers=by_name(), time=times))
    assert len(clip.times) == FRAMES - 1
    assert clip.provenance["reading"]["defects"]


def test_angles_alone_are_no_capture() -> None:
    with pytest.raises(CaptureError, match="a MAT-file of angles; save the joints as one array"):
        read(sample.saved(angles=ANGLES))


def test_what_stands_beside_the_markers_does_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mat5, "_MAX_VALUES", 200)
    deep: Any = 1.0
    for _ in range(30):
        deep = {"a": deep}
    many = sample.cells(["x"] * 500)
    clip = read(sample.saved(deep=deep, many=many, markers=by_name(), fs=sample.RATE, frequency=0.0))
    same_as_tsv(clip)


def test_several_rates_are_named() -> None:
    clip = read(sample.saved(**by_name(), fs=sample.RATE, videoInfo={"frequency": 25.0}))
    assert clip.rate == pytest.approx(sample.RATE)
    assert "other rates in the file: 25 Hz (frequency)" in clip.provenance["reading"]["notes"]


def test_several_recordings_are_named() -> None:
    measured = sample.qtm(LABELS, PLACES)
    clip = read(sample.saved(walk1=measured, walk2=measured))
    assert "2 recordings in the file: the first is read" in clip.provenance["reading"]["notes"]
    both = {label: np.empty((1, 2), dtype=object) for label in LABELS}
    for label, value in by_name().items():
        both[label][0, :] = [value, value]
    with pytest.raises(CaptureError, match=r"expected one recording: .*, found several"):
        read(sample.saved(**both))


def test_of_two_skeletons_the_one_seen_most_is_read() -> None:
    shown = 1000.0 * qualisys_skeleton.places(FRAMES)
    hidden = shown + np.array([0.0, 1500.0, 0.0])
    hidden[5:] = np.nan
    fields = ("SkeletonName", "NrOfSegments", "SegmentLabels", "PositionData")
    both = np.empty((1, 2), dtype=[(name, object) for name in fields])
    for number, points in enumerate((hidden, shown)):
        made = skeleton(f"S{number}", list(qualisys_skeleton.SEGMENTS), points)
        both[0, number] = tuple(made[name] for name in fields)
    clip = read(sample.saved(walk=sample.qtm([], np.zeros((FRAMES, 0, 3)), Skeletons=both)))
    assert np.isfinite(clip.positions).all()
    assert {one["rule"] for one in clip.provenance["reading"]["defects"]} == {"several_people"}


def test_a_skeleton_in_local_coordinates_is_refused() -> None:
    shown = 1000.0 * qualisys_skeleton.places(FRAMES)
    local = {**skeleton("S1", list(qualisys_skeleton.SEGMENTS), shown), "Reference": "Local"}
    with pytest.raises(CaptureError, match="expected skeletons in global coordinates, found Reference Local"):
        read(sample.saved(walk=sample.qtm([], np.zeros((FRAMES, 0, 3)), Skeletons=local)))


def test_velocities_of_the_toolbox_are_refused() -> None:
    velocities = {**sample.toolbox(LABELS, PLACES), "timederOrder": 1.0}
    with pytest.raises(CaptureError, match=r"expected positions .*, found their derivative of order 1"):
        read(sample.saved(d=velocities))


def test_a_structure_of_a_kinects_joints() -> None:
    shown = walk(FRAMES)
    named = ("HipLeft", "KneeLeft", "AnkleLeft", "HipRight", "KneeRight", "AnkleRight", "ShoulderCenter")
    nodes = ["_".join(re.findall("[A-Z][a-z]+", name)).lower() for name in named]
    joints = {name: shown.joints[:, NODE_INDEX[node]] for name, node in zip(named, nodes, strict=True)}
    clip = read(sample.saved(skeleton=joints))
    expected = np.stack([shown.joints[:, NODE_INDEX[node]] for node in clip.skeleton.names], axis=1)
    np.testing.assert_allclose(clip.positions, expected, atol=1e-6)
    assert clip.rate == pytest.approx(30.0)


def cell(value: np.ndarray) -> np.ndarray:
    found = np.empty((1, 1), dtype=object)
    found[0, 0] = value
    return found


def skeleton(name: str, names: list[str], places: np.ndarray) -> dict[str, Any]:
    return {
        "SkeletonName": name,
        "NrOfSegments": float(len(names)),
        "SegmentLabels": sample.cells(names),
        "PositionData": np.moveaxis(places, (0, 1, 2), (2, 1, 0)),
        "RotationData": np.ones((4, len(names), len(places))),
    }


def test_a_skeleton_is_read_at_its_joints() -> None:
    shown = walk(FRAMES, sample.RATE)
    nodes = [NODE_INDEX[node] for node in qualisys_skeleton.SEGMENTS.values()]
    solved = skeleton("S1", list(qualisys_skeleton.SEGMENTS), 1000.0 * shown.joints[:, nodes])
    clip = read(sample.saved(walk=sample.qtm([], np.zeros((FRAMES, 0, 3)), Skeletons=solved)))
    expected = np.stack([shown.joints[:, NODE_INDEX[node]] for node in clip.skeleton.names], axis=1)
    assert {"hip_left", "knee_right", "ankle_left", "foot_left"} <= set(clip.skeleton.names)
    np.testing.assert_allclose(clip.positions, expected, atol=1e-6)


def changed(path: str, value: Any) -> dict[str, Any]:
    found = sample.qtm(LABELS, PLACES)
    *above, last = path.split(".")
    inside = found
    for name in above:
        inside = inside[name]
    inside[last] = value
    return found


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (changed("FrameRate", 0.0), r"a rate in Hz in FrameRate, found 0"),
        (changed("FrameRate", "fast"), r"a rate in Hz in FrameRate, found none"),
        (changed("Trajectories.Labeled.Data", PLACES), r"Data of shape \(\d+ labels, 4, frames\)"),
        (changed("Trajectories.Labeled.Labels", sample.cells([])), "expected labelled trajectories"),
        (changed("Trajectories.Labeled.Labels", sample.cells(["a"] * len(LABELS))), "hips|pelvis"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_said_in_one_line(content: dict[str, Any], expected: str) -> None:
    with pytest.raises(CaptureError, match=expected) as caught:
        read(sample.saved(walk=content))
    assert "\n" not in str(caught.value)


def test_toolbox_without_as_many_numbers_as_names() -> None:
    wrong = {**sample.toolbox(LABELS, PLACES), "data": PLACES[:, :-1].reshape(FRAMES, -1)}
    with pytest.raises(CaptureError, match="3 for each of them"):
        read(sample.saved(d=wrong))
