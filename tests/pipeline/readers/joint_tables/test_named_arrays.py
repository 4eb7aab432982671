"""Archives of places with names: joints, as of Isaac Lab's humanoids, and markers."""

from __future__ import annotations

import hashlib
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples import named_arrays as sample
from samples.motion import in_sight, walk
from samples.trc import markers

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.angles import leg_angles
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.joint_tables import named_arrays

FRAMES = 40
SHOWN = in_sight(walk(FRAMES, sample.RATE))


def read(content: bytes) -> Clip:
    return recognise.read_source(Source(Path("walk.npz"), content, hashlib.sha256(content).hexdigest()))


def archive(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def test_the_known_walk_comes_back() -> None:
    clip = read(sample.files(FRAMES)["walk.npz"])
    assert clip.rate == pytest.approx(sample.RATE)
    assert clip.provenance["format"] == "named joint array"
    for name, curve in leg_angles(to_nodes(clip)[0]).items():
        assert np.abs(curve - SHOWN.angles[name]).max() < 1e-3, name


def test_markers_in_millimetres_with_times() -> None:
    places = markers(SHOWN)
    points = 1000.0 * np.stack(list(places.values()), axis=1)
    clip = read(archive(labels=np.array(list(places), dtype="S"), data=points, time=SHOWN.times + 3.0))
    assert clip.times - clip.times[0] == pytest.approx(SHOWN.times)
    assert clip.provenance["reading"]["units"] == "mm"
    for name, curve in leg_angles(to_nodes(clip)[0]).items():
        assert np.abs(curve - SHOWN.angles[name]).max() < 1e-5, name


@pytest.mark.parametrize(("begin", "unit"), [(1.7e9, 1.0), (1.7e12, 1e-3), (3.6e12, 1e-9), (6.3e17, 1e-7)])
def test_times_since_long_ago(begin: float, unit: float) -> None:
    """Seconds and milliseconds of 1970, nanoseconds since the start of the computer, ticks of .NET."""
    places = markers(SHOWN)
    points = np.stack(list(places.values()), axis=1)
    clip = read(archive(labels=np.array(list(places)), data=points, timestamps=begin + SHOWN.times / unit))
    assert clip.times - clip.times[0] == pytest.approx(SHOWN.times, abs=1e-4)


def test_places_are_neither_velocities_nor_centres_of_mass() -> None:
    """MuJoCo's names: the order of the archive does not matter."""
    points = SHOWN.joints[:, [NODE_INDEX[node] for node in sample.BODIES.values()]]
    arrays = {
        "xpos": points,
        "xipos": 0.5 * points,
        "cvel_linear": 0.0 * points,
        "subtree_com": points[:, ::-1],
    }
    names = np.array(list(sample.BODIES))
    clips = [
        read(archive(body_names=names, **dict(items))) for items in (arrays.items(), [*arrays.items()][::-1])
    ]
    for clip in clips:
        assert (
            np.abs(
                to_nodes(clip)[0][:, NODE_INDEX["knee_left"]] - SHOWN.joints[:, NODE_INDEX["knee_left"]]
            ).max()
            < 1e-6
        )


def test_no_body() -> None:
    names = np.array(list(sample.BODIES))
    with pytest.raises(CaptureError, match="found others, a name twice, or no joint of the trunk"):
        read(archive(names=np.append(names, "head"), points=np.zeros((FRAMES, 16, 3))))
    with pytest.raises(CaptureError, match="expected numbers in points, found <U4"):
        read(archive(names=names, points=np.full((FRAMES, 15, 3), "no!!")))
    with pytest.raises(CaptureError, match=r"an \.npz archive of names, points"):
        read(archive(names=np.array([f"box {k}" for k in range(15)]), points=np.zeros((FRAMES, 15, 3))))
    with pytest.raises(CaptureError, match=r"an \.npz archive of names, points"):
        read(archive(names=names, points=np.zeros((0, 15, 3))))


def test_more_numbers_than_a_text_can_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(named_arrays, "_MOST_NUMBERS", 1000)
    with pytest.raises(CaptureError):
        read(sample.files(FRAMES)["walk.npz"])
