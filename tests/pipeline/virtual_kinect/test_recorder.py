"""The virtual Kinect as a whole: its files are consistent with each other and with the truth."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from samples.noiseless import NOISELESS

from kinemimic.pipeline.convert import convert
from kinemimic.pipeline.files.sidecars import note_path, read_note, truth_path
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.angles import ANGLES, leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.quality.passes import find_passes
from kinemimic.pipeline.readers.recognise import read
from kinemimic.pipeline.virtual_kinect.noise import NoiseLevels
from kinemimic.pipeline.virtual_kinect.recorder import Recording, record_virtual

FORMS = ("skl", "euler")
# But for the feet, whose direction reaches no angle.
PERFECT = replace(NOISELESS, foot_drop=NoiseLevels().foot_drop)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return record_virtual(tmp_path_factory.mktemp("virtual"))


@pytest.fixture(scope="module")
def perfect(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return record_virtual(tmp_path_factory.mktemp("perfect"), levels=PERFECT)


def _truth(path: Path) -> dict[str, np.ndarray]:
    table = pq.read_table(truth_path(path))
    return {name: table[name].to_numpy() for name in table.column_names}


def _note(path: Path) -> dict[str, Any]:
    return read_note(note_path(path))


def _form(recording: Recording, form: str) -> tuple[Path, Clip]:
    path = getattr(recording, form)
    return path, read(path)


def test_the_same_seed_writes_the_same_bytes(recording: Recording, tmp_path: Path) -> None:
    again, other = record_virtual(tmp_path / "a"), record_virtual(tmp_path / "b", seed=1)
    for form in FORMS:
        for suffix in ("", ".truth.parquet", ".provenance.json"):
            paths = [getattr(r, form) for r in (recording, again, other)]
            texts = [(p.with_suffix(suffix) if suffix else p).read_bytes() for p in paths]
            assert texts[0] == texts[1] != texts[2]


@pytest.mark.parametrize("form", FORMS)
def test_the_truth_is_on_the_captures_clock_and_labelled(recording: Recording, form: str) -> None:
    path, clip = _form(recording, form)
    truth = _truth(path)
    np.testing.assert_array_equal(truth["time"], clip.times)
    assert _note(path)["simulated"] is True
    metadata = json.loads(pq.read_schema(path.with_suffix(".truth.parquet")).metadata[b"kinemimic"])
    assert metadata["provenance"] == _note(path)
    away = truth["pass"] < 0
    for name in ANGLES:
        assert np.array_equal(np.isnan(truth[name]), away)


@pytest.mark.parametrize("form", FORMS)
def test_acquisition_finds_the_passes_that_were_walked(recording: Recording, form: str) -> None:
    path, clip = _form(recording, form)
    found, walked = find_passes(clip).passes, _truth(path)["pass"]
    # A disturbed first frame may be cut off, and the frame before a pause counts as its first repetition.
    middle = np.convolve(walked, np.full(13, 1 / 13), mode="same") == walked
    assert walked.max() == 5 and np.array_equal(found[middle], walked[middle])


def test_a_perfect_sensor_reports_the_truth(perfect: Recording) -> None:
    for form, tolerance in (("skl", 0.01), ("euler", 0.01)):
        path, clip = _form(perfect, form)
        truth, (positions, _) = _truth(path), to_nodes(clip)
        seen = leg_angles(positions)
        for name in ANGLES:
            error = np.degrees(seen[name] - truth[name])[truth["pass"] >= 0]
            assert np.sqrt(np.nanmean(error**2)) < tolerance, (form, name)


def test_both_forms_show_the_defects_and_still_the_walk(recording: Recording) -> None:
    for form in FORMS:
        path, clip = _form(recording, form)
        truth, (positions, _) = _truth(path), to_nodes(clip)
        seen = leg_angles(positions)
        for name in ANGLES:
            error = np.abs(np.degrees(seen[name] - truth[name]))[truth["pass"] >= 0]
            assert 1.5 < np.nanmedian(error) < 8.0, (form, name)
        assert 0 < len(_note(path)["swapped"]) < 40


def test_the_clock_is_that_of_a_kinect(recording: Recording) -> None:
    _, clip = _form(recording, "skl")
    steps = np.diff(clip.times)
    walking = steps[steps < 0.5]
    assert 0.031 <= np.median(walking) <= 0.033
    assert walking.mean() == pytest.approx(1 / 30, rel=0.05) and walking.std() > 1e-3
    assert np.sum(steps > 3.0) == 5 and 0 < np.mean(walking > 0.055) < 0.05


def test_shares_of_inferred_joints_are_those_of_real_walks(recording: Recording) -> None:
    _, clip = _form(recording, "skl")
    share = (clip.states == 1).mean(axis=0)
    for joint in ("knee", "ankle", "foot"):
        for side in ("left", "right"):
            assert 0.08 < share[N[f"{joint}_{side}"]] < 0.30
    assert share[N["hip_left"]] == share[N["hip_center"]] == 0.0
    assert (clip.states == 0).mean() < 0.01


def test_only_the_locked_joint_is_near_lock_at_the_recorded_frame(recording: Recording) -> None:
    path, clip = _form(recording, "euler")
    gimbal = _note(path)["gimbal"]
    assert isinstance(gimbal, dict) and gimbal["joint"] == "ShoulderLeft" and gimbal["order"] == "YZX"
    assert clip.euler is not None and clip.orders is not None
    assert {order for order in clip.orders if order} == {"YZX"}
    middle = np.degrees(np.abs(clip.euler[..., 1]))
    joint = clip.skeleton.index("ShoulderLeft")
    assert [int(frame) for frame in np.flatnonzero(middle[:, joint] >= 85.0)] == gimbal["frames"]
    assert len(gimbal["frames"]) >= 5
    nearest = gimbal["nearest"]
    assert nearest["frame"] == int(np.argmax(middle[:, joint]))
    assert 1e-3 <= nearest["deg_from_lock"] <= 0.1
    assert np.delete(middle, joint, axis=1).max() < 85.0


def test_convert_reports_the_locked_joint_and_frames(recording: Recording, tmp_path: Path) -> None:
    ingest(recording.euler, tmp_path)
    convert(tmp_path)
    planted = _note(recording.euler)["gimbal"]
    assert isinstance(planted, dict)
    reports = json.loads((tmp_path / "gimbal.json").read_text())["joints"]
    flagged = {
        report["joint"]: [k for first, last in report["flagged_frames"] for k in range(first, last + 1)]
        for report in reports
        if report["flagged_frames"]
    }
    assert flagged == {planted["joint"]: planted["frames"]}


def test_at_lock_the_angles_jump_and_the_rotation_does_not(perfect: Recording) -> None:
    path, clip = _form(perfect, "euler")
    assert clip.euler is not None and clip.rotations is None
    gimbal = _note(path)["gimbal"]
    assert isinstance(gimbal, dict)
    frame, joint = gimbal["nearest"]["frame"], clip.skeleton.index("ShoulderLeft")
    window = slice(frame - 3, frame + 4)
    triples = np.degrees(np.abs(np.diff(clip.euler[window, joint], axis=0))).max()
    elbow, shoulder = clip.skeleton.index("ElbowLeft"), joint
    arm = clip.positions[window, elbow] - clip.positions[window, shoulder]
    turn = np.degrees(np.arccos(np.sum(arm[1:] * arm[:-1], axis=1) / np.sum(arm * arm, axis=1)[1:]))
    assert triples > 20.0 and turn.max() < 10.0


def test_the_last_pose_is_repeated_after_the_subject_left(recording: Recording) -> None:
    path, clip = _form(recording, "euler")
    away = np.flatnonzero(_truth(path)["pass"] < 0)
    assert len(away) == 5 * 21
    assert clip.euler is not None
    np.testing.assert_array_equal(clip.euler[away], clip.euler[away - 1])
    np.testing.assert_array_equal(clip.positions[away], clip.positions[away - 1])


def test_the_run_is_recorded_too(tmp_path: Path) -> None:
    path, clip = _form(record_virtual(tmp_path, motion="run"), "skl")
    truth = _truth(path)
    assert path.name == "kinect_run.skl" and find_passes(clip).count >= 15
    assert 90.0 < np.degrees(np.nanmax(truth["knee_left"])) < 125.0
