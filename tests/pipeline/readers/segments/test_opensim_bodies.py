"""Tracks of OpenSim's bodies, written here from the known walk, and the published ones."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples import opensim_bodies as sample
from samples import source_of
from samples.motion import rigid_walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.orientation.rest_pose import node_rotations_of
from kinemimic.pipeline.kinematics.rotations import angle_between
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise

FRAMES = 40
TEXT = sample.files(FRAMES)["walk.json"].decode()


def read(text: str) -> Clip:
    return recognise.read_source(source_of(text, Path("walk.json")))


def test_the_walk() -> None:
    clip, shown = read(TEXT), rigid_walk(FRAMES, sample.RATE)
    positions = to_nodes(clip)[0]
    assert np.abs(clip.times - shown.times).max() < 1e-6
    for node in ("hip_left", "knee_right", "ankle_left", "foot_right", "shoulder_left", "wrist_right"):
        assert np.abs(positions[:, NODE_INDEX[node]] - shown.joints[:, NODE_INDEX[node]]).max() < 1e-7
    recorded = node_rotations_of(clip)
    for node in ("hip_left", "knee_left", "elbow_right"):
        apart = angle_between(recorded.rotations[:, NODE_INDEX[node]], shown.rotations[:, NODE_INDEX[node]])
        # The pelvis' own pitch is not in the hips and shoulders: a constant is left to it.
        assert apart.max() < np.radians(4.0)
        assert np.ptp(apart) < np.radians(0.5)


def put(*path: str, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(content: dict[str, Any]) -> None:
        for key in path[:-1]:
            content = content[key]
        content[path[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            lambda content: content["bodies"].pop("tibia_l"),
            "expected the bodies femur_l, .* found no tibia_l",
        ),
        (put("bodies", value=[{"translation": 1}]), 'expected an object "bodies" of bodies, found list'),
        (put("time", value=[0.0, "a"]), 'expected a list "time" of seconds, found something else'),
        (
            put("bodies", "tibia_l", "rotation", value=[[0.0, 0.0, 0.0]]),
            r"rotation of tibia_l of shape \(40, 3\)",
        ),
        (
            put("bodies", "tibia_l", "translation", value=[[0.0, 0.0, 1e4]] * 40),
            "frame 0: expected at most 100 m in Z of knee_left",
        ),
        (put("bodies", "hand_r", value=7), "expected translation of hand_r|expected rotation of hand_r"),
    ],
)
def test_damage_is_named(change: Callable[[dict[str, Any]], object], says: str) -> None:
    content = json.loads(TEXT)
    change(content)
    with pytest.raises(CaptureError, match=says):
        read(json.dumps(content, indent=1))


@pytest.mark.parametrize("name", ["walk/sample_mocap", "walk/sample_wham", "STS/sample_mono"])
def test_published_tracks(sensors: Path, name: str) -> None:
    """Lengths are a person's, and the shank keeps its own frame: the rotations belong to the positions."""
    clip = recognise.read(sensors / "video_opencap" / f"{name}.json")
    assert clip.rate == pytest.approx(100.0)
    positions = to_nodes(clip)[0]
    for side in ("left", "right"):
        hip, knee, ankle = (positions[:, NODE_INDEX[f"{joint}_{side}"]] for joint in ("hip", "knee", "ankle"))
        assert 0.35 < np.median(np.linalg.norm(hip - knee, axis=-1)) < 0.48
        assert 0.35 < np.median(np.linalg.norm(ankle - knee, axis=-1)) < 0.48
    assert (
        positions[:, NODE_INDEX["shoulder_center"], 2].min() > positions[:, NODE_INDEX["knee_left"], 2].max()
    )
    assert {"hip_left", "knee_left"} <= node_rotations_of(clip).sources.keys()
