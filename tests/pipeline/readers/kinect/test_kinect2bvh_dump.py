"""The raw dump of Kinect2BVH: blocks with intermittent joints, and a person without legs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import source_of
from samples.kinect2bvh_dump import TIPS, files, text
from samples.motion import Walk, in_range, kinect_v2_joints, walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK, KINECT_V2_JOINTS, SDK_JOINTS
from kinemimic.pipeline.readers.recognise import read, read_source

PATH = Path("raw.txt")


def clip_of(content: str) -> Clip:
    return read_source(source_of(content, PATH))


def test_the_written_walk_is_read_with_intermittent_tips() -> None:
    clip = clip_of(files(9)["raw.txt"].decode())
    seen = walk(9)
    truth = kinect_v2_joints(Walk(seen.times, in_range(seen), seen.angles))[:, FROM_SDK]
    missing = np.zeros((9, 25), dtype=bool)
    missing[::3, [KINECT_V2_JOINTS.index(SDK_JOINTS[j]) for j in TIPS]] = True
    assert clip.skeleton.names == KINECT_V2_JOINTS
    assert np.array_equal(clip.states == 0, missing)
    assert np.abs(clip.positions - truth)[~missing].max() < 1e-6
    assert clip.times == pytest.approx((3178718 + np.round(100 * np.arange(9) / 3)) / 1000)


def test_upper_bodies_are_refused_listing_their_joints() -> None:
    above = tuple(range(12))
    with pytest.raises(
        CaptureError, match="expected hips, knees and ankles, found a whole leg in 0 of 9 frames"
    ):
        clip_of(text(9, above))
    # One leg is enough to be read; what to do without the other is for later stages.
    assert (clip_of(text(9, (*above, 12, 13, 14))).states[:, KINECT_V2_JOINTS.index("KneeLeft")] == 2).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t[: t.rfind("Rot")], "expected Rot N, found the end|line .*cut off"),
        (lambda t: "\n".join(t.split("\n")[:-4]) + "\n", "expected complete blocks, found 3 lines missing"),
        (
            lambda t: t.replace("Pos 21", "Pos 999999999", 1),
            "line 2: expected 1 to 25 joints, found 999999999",
        ),
        (lambda t: t.replace("Pos 25", "Pos 24", 1), "expected Rot N, found '24 "),
        (lambda t: t.replace("Rot 21", "Rot 20", 1), "expected Rot 21, found 20"),
        (lambda t: t.replace("\n0 0", "\n0 x", 1), "the block of line 3: expected `joint x y z`, found '0 x"),
        (lambda t: t.replace("\n0 ", "\n25 ", 1), "expected the index of a joint, 0 to 24, found 25"),
        (lambda t: t.replace("\n3178751\n", "\nnoon\n"), "expected a time in ms, found 'noon'"),
        (lambda t: t.replace("\n0 ", "\n0 700", 1), "line 3: expected at most 100 m in X of SpineBase"),
    ],
)
def test_damage_names_its_line(change: Callable[[str], str], message: str) -> None:
    with pytest.raises(CaptureError, match=message):
        clip_of(change(text(9)))


def test_a_repeated_time_is_dropped_and_counted() -> None:
    clip = clip_of(text(9).replace("\n3178751\n", "\n3178718\n"))
    assert len(clip.times) == 8
    assert [d["rule"] for d in clip.provenance["reading"]["defects"]] == ["duplicate_frames"]


def test_the_real_dump_is_a_person_at_a_desk(captures: Path) -> None:
    with pytest.raises(CaptureError, match="hips, knees and ankles, found a whole leg in 2 of 219 frames"):
        read(captures / "kinect2_kinect2bvh" / "rawtest.txt")
