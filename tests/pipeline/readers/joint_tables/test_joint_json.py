"""JSON of joints is read as the same body, whatever its keys are called, or is no capture."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.joint_table import NAMES
from samples.motion import walk, y_up

from kinemimic.pipeline.errors import NotACaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.readers import recognise

FRAMES, RATE = 45, 25.0
WALK = walk(FRAMES, RATE)
POINTS = y_up(WALK.joints)
TIMES = WALK.times.tolist()
PLACES: list[list[list[float]]] = POINTS.tolist()


def xyz(place: list[float], axes: str = "xyz") -> dict[str, float]:
    return dict(zip(axes, place, strict=True))


def each(frame: Callable[[float, list[list[float]]], Any]) -> list[Any]:
    return [frame(time, places) for time, places in zip(TIMES, PLACES, strict=True)]


def by_name(places: list[list[float]]) -> dict[str, Any]:
    return {name: xyz(place) for name, place in zip(NAMES, places, strict=True)}


def body(number: int, places: list[list[float]]) -> dict[str, Any]:
    return {
        "id": number,
        "joints": {
            name: {"state": "Tracked", "location": one, "rotation": {"x": 0, "y": 0, "z": 0, "w": 1}}
            for name, one in by_name(places).items()
        },
    }


def node_kinect2(time: float, places: list[list[float]]) -> dict[str, Any]:
    joints = [
        {**xyz(place, ("cameraX", "cameraY", "cameraZ")), "colorX": 0.5, "colorY": 0.25, "trackingState": 2}  # type: ignore[arg-type]
        for place in places
    ]
    return {"time": time, "bodies": [{"bodyIndex": 0, "tracked": False}, {"bodyIndex": 3, "joints": joints}]}


LAYOUTS: dict[str, Callable[[], Any]] = {
    "joints by name": lambda: each(lambda t, places: {"timestamp": 1000 * t, "joints": by_name(places)}),
    "flat names": lambda: each(
        lambda t, places: {
            "t": t, **{f"{name}_{a}": v for name, one in by_name(places).items() for a, v in one.items()}
        }
    ),
    "three numbers each, and the rate": lambda: {
        "meta": {"fps": RATE},
        "frames": each(lambda t, places: {"pose": dict(zip(NAMES, places, strict=True))}),
    },
    "in the sensor's order": lambda: each(lambda t, places: {"time": t, "skeleton": places}),
    "frames by their numbers": lambda: {
        f"{k}": frame
        for k, frame in enumerate(each(lambda t, places: {"time": t, "joints": by_name(places)}))
    },
    "people in a list": lambda: each(lambda t, places: {"timestamp": t, "bodies": [body(7, places)]}),
    "an order, and people who are not there": lambda: each(node_kinect2),
}  # fmt: skip


def check(path: Path) -> None:
    clip = check_capture(recognise.read(path)).clip
    assert clip.provenance["format"] == "joint JSON"
    assert clip.times[-1] - clip.times[0] == pytest.approx(TIMES[-1], rel=1e-3)
    truth = leg_angles(WALK.joints, times=np.array(TIMES))
    for name, found in leg_angles(to_nodes(clip)[0], times=clip.times).items():
        assert np.degrees(np.abs(found - truth[name])).max() < 0.1, name


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_same_body_from_every_layout(layout: str, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps(LAYOUTS[layout]()))
    check(tmp_path / "a.json")


def test_a_frame_in_each_line(tmp_path: Path) -> None:
    lines = each(lambda t, places: json.dumps({"time": t, "joints": by_name(places)}))
    (tmp_path / "a.json").write_text("\n".join(lines))
    check(tmp_path / "a.json")


def test_people_are_told_by_their_numbers_not_their_places(tmp_path: Path) -> None:
    """The second comes in front of the first in the list, and leaves again."""
    frames = []
    for number, (time, places) in enumerate(zip(TIMES, PLACES, strict=True)):
        other = body(2, np.add(places, [1.5, 0.0, 0.5]).tolist())
        bodies = [other, body(1, places)] if 10 < number < 30 else [body(1, places)]
        frames.append({"timestamp": time, "bodies": bodies})
    (tmp_path / "a.json").write_text(json.dumps(frames))
    check(tmp_path / "a.json")
    (defect,) = recognise.read(tmp_path / "a.json").provenance["reading"]["defects"]
    assert (defect["rule"], defect["count"], defect["action"]) == ("several_people", 1, "repaired")


@pytest.mark.parametrize(
    "content", [{"joints": 3}, [{"joints": [1, 2]}], [{"skeleton": [[0, 0, 0]] * 20}] * 9]
)
def test_other_json_is_no_capture(content: Any, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps(content))
    with pytest.raises(NotACaptureError, match=r"expected (?:frames with joints|a list of frames)"):
        recognise.read(tmp_path / "a.json")
