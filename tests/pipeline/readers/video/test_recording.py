"""A phone's video against optical capture, and options that only a video takes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.body_fit.body import POINT_INDEX, POINTS
from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, NODE_INDEX, TRACKED
from kinemimic.pipeline.overlay.video_overlay import camera_of
from kinemimic.pipeline.readers.recognise import formats, read
from kinemimic.pipeline.readers.video.container import FORMAT
from kinemimic.pipeline.readers.video.options import VideoOptions
from kinemimic.pipeline.readers.video.recording import observed_of, states_of
from kinemimic.pipeline.video.landmark_track import LandmarkTrack
from kinemimic.pipeline.video.track import Followed


def angle(first: Array, second: Array) -> Array:
    product = np.linalg.norm(first, axis=-1) * np.linalg.norm(second, axis=-1)
    return np.degrees(np.arccos(np.clip(np.sum(first * second, axis=-1) / product, -1.0, 1.0)))


def legs(points: dict[str, Array]) -> dict[str, Array]:
    """Knee and hip (T,) of both sides in degrees; points: hip, knee, ankle, shoulder and side -> (T, 3)."""
    hips, shoulders = ((points[f"{j}_left"] + points[f"{j}_right"]) / 2.0 for j in ("hip", "shoulder"))
    found = {}
    for side in ("left", "right"):
        thigh = points[f"knee_{side}"] - points[f"hip_{side}"]
        found[f"knee_{side}"] = angle(thigh, points[f"ankle_{side}"] - points[f"knee_{side}"])
        found[f"hip_{side}"] = angle(hips - shoulders, thigh)
    return found


@pytest.fixture(scope="module")
def walk(captures: Path) -> Path:
    folder = captures.parent / "sensors" / "video_opencap" / "walk"
    if not folder.is_dir():
        pytest.skip("no video with an optical truth beside the real recordings")
    pytest.importorskip("ai_edge_litert", reason="the extra video is not installed")
    return folder


@pytest.mark.slow
def test_knees_and_hips_of_a_walk_are_near_the_optical_ones(walk: Path) -> None:
    clip: Clip = read(walk / "video.mp4")
    assert len(clip.times) == 75 and clip.rate == pytest.approx(60.0)
    content = json.loads((walk / "sample_mocap.json").read_text())
    names = {"hip": "femur", "knee": "tibia", "ankle": "talus", "shoulder": "humerus"}
    truth = legs(
        {
            f"{joint}_{side}": np.array(content["bodies"][f"{body}_{side[0]}"]["translation"])
            for joint, body in names.items()
            for side in ("left", "right")
        }
    )
    found = legs({name: clip.positions[:, k] for name, k in NODE_INDEX.items()})
    error = {
        name: np.sqrt(np.mean((np.interp(content["time"], clip.times, found[name]) - curve) ** 2))
        for name, curve in truth.items()
    }
    assert (error["knee_left"] + error["knee_right"]) / 2.0 < 7.0
    assert (error["hip_left"] + error["hip_right"]) / 2.0 < 6.0
    # The feet are on the floor, and the fitted camera sees the nodes within the image.
    assert clip.positions[:, NODE_INDEX["foot_left"], 2].min() > -0.05
    pixels = camera_of(clip).project(clip.positions)
    assert ((pixels > 0.0) & (pixels < camera_of(clip).size)).all()


def track(frames: int = 4) -> LandmarkTrack:
    return LandmarkTrack(
        times=np.arange(frames) / 30.0,
        pixels=np.zeros((frames, 33, 2)),
        world=np.zeros((frames, 33, 3)),
        visibility=np.ones((frames, 33)),
        size=(720, 1280),
        key="",
        done=True,
        followed=Followed(),
        people=1,
    )


def test_a_joint_is_as_sure_as_what_the_network_sees_of_it() -> None:
    from kinemimic.pipeline.body_fit.sequence import FittedBody  # noqa: PLC0415

    seen = track()
    seen.visibility[0, 25] = 0.2  # the left knee
    seen.pixels[3] = np.nan
    observed = observed_of(seen)
    misfit = np.zeros((4, len(POINTS)))
    misfit[1, POINT_INDEX["instep_right"]] = 5.0
    points = np.ones((4, len(POINTS), 3))
    points[2] = np.nan
    states = states_of(observed, FittedBody(points, misfit, None, 1.7, 1))  # type: ignore[arg-type]
    assert states[0, NODE_INDEX["knee_left"]] == INFERRED and states[0, NODE_INDEX["knee_right"]] == TRACKED
    assert states[1, NODE_INDEX["ankle_right"]] == INFERRED and states[1, NODE_INDEX["ankle_left"]] == TRACKED
    assert (states[2] == MISSING).all() and (states[3] == INFERRED).all()


def test_a_video_is_among_the_formats() -> None:
    assert FORMAT in formats()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"height": 3.0}, "height of 0.5 to 2.6 m"),
        ({"fov": 5.0}, "fov of 10 to 150"),
        ({"person": 0}, "person 1"),
    ],
)
def test_impossible_options_are_refused(options: dict[str, float], said: str) -> None:
    with pytest.raises(KinemimicError, match=said):
        VideoOptions(**options)  # type: ignore[arg-type]


def test_only_a_video_takes_its_options_and_a_video_takes_no_unit(tmp_path: Path) -> None:
    table, clip = tmp_path / "walk.csv", tmp_path / "walk.mp4"
    table.write_text("a,b\n1,2\n")
    clip.write_bytes(bytes(4) + b"ftypisom" + bytes(100))
    with pytest.raises(CaptureError, match="expected a video, which alone takes --height"):
        read(table, video=VideoOptions(height=1.8))
    with pytest.raises(CaptureError, match=r"expected the person's height \(--height\)"):
        read(clip, unit="cm")
