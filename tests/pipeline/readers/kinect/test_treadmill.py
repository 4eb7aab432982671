"""Treadmill ASCII: an impossible rate, empty frames, and its own angles compared with the joints'."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import source_of
from samples.motion import in_range, walk
from samples.treadmill import files

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers.kinect.treadmill import angles_of_recorder, true_rate
from kinemimic.pipeline.readers.recognise import read, read_source

PATH = Path("walk.txt")


def sample(frames: int = 12) -> str:
    return files(frames)["skeleton_3d.txt"].decode()


def clip_of(text: str) -> Clip:
    return read_source(source_of(text, PATH))


def defects(clip: Clip) -> dict[str, int]:
    return {defect["rule"]: defect["count"] for defect in clip.provenance["reading"]["defects"]}


def test_the_written_walk_is_read() -> None:
    clip = clip_of(sample())
    assert clip.provenance["format"] == "treadmill ASCII"
    # Six digits of metres; the last frame is zeros.
    assert np.abs(clip.positions - in_range(walk(12)))[:-1].max() < 5e-6
    assert np.isnan(clip.positions[-1]).all()
    assert (clip.states[-1] == 0).all()
    assert clip.times == pytest.approx(np.arange(12) / 30.0)
    assert defects(clip) == {"zero_frames": 1}
    assumed = {"rate": 30.0, "declared": 50.0, "sensor": "Kinect v1"}
    assert clip.provenance["reading"]["assumed_rate"] == assumed


def test_its_own_angles_are_flexion() -> None:
    clip = clip_of(sample())
    assert clip.angles is not None
    assert {"knee_left", "knee_right", "ankle_left", "elbow_right", "shoulder_left"} <= set(clip.angles)
    ours = leg_angles(clip.positions)
    for knee in ("knee_left", "knee_right"):
        # Hyperextension is negative in ours; an internal angle has no sign.
        assert clip.angles[knee][:-1] == pytest.approx(np.abs(ours[knee][:-1]), abs=2e-4)
        assert np.isnan(clip.angles[knee][-1])


def test_a_right_angle_of_each_joint() -> None:
    labels = ("Left Knee Angle", "Right Foot Angle", "Left Elbow Angle", "Right Shoulder Angle", "Nose Angle")
    degrees = {label: np.array([120.0, 0.0]) for label in labels}
    curves = angles_of_recorder(degrees)
    assert set(curves) == {"knee_left", "ankle_right", "elbow_left", "shoulder_right"}
    first = {name: float(np.degrees(curve[0])) for name, curve in curves.items()}
    assert first == pytest.approx(
        {"knee_left": 60, "ankle_right": -30, "elbow_left": 60, "shoulder_right": 30}
    )
    assert all(np.isnan(curve[1]) for curve in curves.values())


@pytest.mark.parametrize(("declared", "rate"), [(50, 30), (30, 30), (15, 15), (0, 30), (float("nan"), 30)])
def test_no_kinect_v1_gives_more_than_thirty_frames(declared: float, rate: float) -> None:
    found, facts = true_rate(declared)
    assert found == rate
    assert facts.keys() == (set() if declared == rate else {"assumed_rate"})
    if facts:
        assert facts["assumed_rate"]["declared"] == (50.0 if declared == 50 else None)


def test_frames_declared_but_missing_are_reported() -> None:
    clip = clip_of("\n".join(sample().split("\n")[:-3]) + "\n")
    assert len(clip.times) == 10
    (lost,) = [d for d in clip.provenance["reading"]["defects"] if d["rule"] == "dropped_frames"]
    assert (lost["count"], lost["action"]) == (2, "flagged")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t[:-60], "line 20: expected 85 numbers, found .*; the file is cut off there"),
        (
            lambda t: t.replace("Left Knee\t", "Left Kne\t"),
            "line 6: expected the names of 20 joints, found no Left Knee",
        ),
        (
            lambda t: t.replace("\tm\t", "\tmm\t"),
            "line 7: expected a line of units: s, m and degrees, found mm",
        ),
        (lambda t: t.replace("number\t12", "number\t1e99"), "line 1: expected a number, found '1e99'"),
        (lambda t: t.replace("frequency\t50", "frequency\tx", 1), "line 3: expected a number, found 'x'"),
        (lambda t: t.replace("\n0.02\t", "\nnan\t"), "line 10: expected a time in seconds, found nan"),
        (
            lambda t: t.replace("\n0.02\t", "\n0.02\t400"),
            "line 10: expected at most 100 m in X of Hip Center, found",
        ),
    ],
)
def test_damage_names_its_line(change: Callable[[str], str], message: str) -> None:
    with pytest.raises(CaptureError, match=message):
        clip_of(change(sample()))


@pytest.mark.parametrize(
    ("take", "frames", "thigh", "shank"),
    [("19h58m42", 1449, (0.44, 0.48), (0.38, 0.42)), ("20h17m38", 352, (0.30, 0.36), (0.21, 0.27))],
)
def test_real_takes(
    captures: Path, take: str, frames: int, thigh: tuple[float, float], shank: tuple[float, float]
) -> None:
    clip = read(captures / "kinect1_treadmill_c3d" / f"skeleton_3d_{take}.txt")
    assert len(clip.times) == frames
    assert clip.rate == pytest.approx(30.0)
    assert defects(clip) == {"zero_frames": 1}
    assert np.flatnonzero((clip.states == 0).all(axis=1)).tolist() == [frames - 1]
    hip, knee, ankle = (clip.positions[:, NODE_INDEX[f"{joint}_left"]] for joint in ("hip", "knee", "ankle"))
    assert thigh[0] < np.nanmedian(np.linalg.norm(knee - hip, axis=-1)) < thigh[1]
    assert shank[0] < np.nanmedian(np.linalg.norm(ankle - knee, axis=-1)) < shank[1]
    # The recorder's knee is 180 deg less the flexion of its own joints: the same curve, to its six digits.
    assert clip.angles is not None
    ours = leg_angles(clip.positions)
    for name in ("knee_left", "knee_right"):
        theirs, flexion = clip.angles[name][:-1], np.abs(ours[name][:-1])
        assert np.corrcoef(theirs, flexion)[0, 1] > 0.9999
        assert abs(np.degrees(np.median(theirs - flexion))) < 0.01
