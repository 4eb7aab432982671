"""joints.csv and times.csv."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import source_of

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.depth.tables import JointTable, read_joints, read_times

FRAMES = (3, 4, 6)


def joints(text: str) -> JointTable:
    return read_joints(source_of(text, Path("joints.csv")), FRAMES, 1000.0)


def test_lines_find_their_frame_and_joint() -> None:
    table = joints(
        "Joint, frame,v,u,depth,state\r\nhead,6,2,1,2500,1\r\n\r\n"
        "head,3,4,3,,2\r\nhip,4,6,5,0,0\r\nhip,3,,,7,2\r\n"
    )
    assert table.names == ("head", "hip")
    nan = np.nan
    assert table.pixels == pytest.approx(
        np.array([[[3, 4], [nan, nan]], [[nan, nan], [5, 6]], [[1, 2], [nan, nan]]]), nan_ok=True
    )
    assert table.depth == pytest.approx(np.array([[nan, 0.007], [nan, nan], [2.5, nan]]), nan_ok=True)
    assert table.states.tolist() == [[2, 2], [0, 0], [1, 0]]
    assert table.has_depth
    assert table.frames_without_image == 0


def test_frames_without_an_image_are_counted() -> None:
    table = joints("frame,joint,u,v\n1,head,1,1\n5,head,1,1\n5,hip,1,1\n9,head,1,1\n4,head,8,9\n")
    assert table.frames_without_image == 3
    assert table.pixels[1, 0].tolist() == [8, 9]
    assert np.isnan(table.pixels[[0, 2]]).all()
    assert not table.has_depth


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("frame,joint,u\n3,head,1\n", "line 1: expected a header with frame, joint, u, v, found no v"),
        ("frame,joint,u,v,v\n", "line 1: expected a header with frame, joint, u, v, found one twice"),
        ("frame,joint,u,v\n", "expected joints below the header"),
        ("frame,joint,u,v\n3,head,1\n", "line 2: expected 4 fields, found 3"),
        (
            "frame,joint,u,v\n3,head,1,x\n",
            "line 2: expected a number from .* as u and v, found 'x'",
        ),
        ("frame,joint,u,v\n3,head,1,inf\n", "line 2: expected a number"),
        ("frame,joint,u,v\n3,head,1,1_0\n", "line 2: expected a number"),
        ("frame,joint,u,v\n3,head,1,1\n3.5,head,1,1\n", "line 3: expected a whole number as frame"),
        ("frame,joint,u,v\n-3,head,1,1\n", "line 2: expected a number"),
        ("frame,joint,u,v\n3,,1,1\n", "line 2: expected names of at most"),
        ("frame,joint,u,v,depth\n3,head,1,1,-5\n", "line 2: expected a number from 0 to 100000 as depth"),
        ("frame,joint,u,v,state\n3,head,1,1,3\n", "line 2: expected a number from 0 to 2 as state"),
        ("frame,joint,u,v,state\n3,head,1,1,0.5\n", "line 2: expected 0, 1 or 2 as state"),
        (
            "frame,joint,u,v\n3,head,1,1\n\n3,head,2,2\n",
            "line 4: .* once per frame, found head of frame 3",
        ),
        ('frame,joint,u,v\n3,"head,1,1\n', "expected"),
        ("frame,joint,u,v\n3," + 200_000 * "a" + ",1,1\n", "comma separated values"),
        (
            "frame,joint,u,v\n" + "".join(f"3,j{k},1,1\n" for k in range(300)),
            "line 202: expected names of at most 200",
        ),
    ],
)
def test_a_mistake_names_its_line(text: str, message: str) -> None:
    with pytest.raises(CaptureError, match=message):
        joints(text)


def times(text: str) -> list[float]:
    return read_times(source_of(text, Path("times.csv")), FRAMES).tolist()


def test_times_in_any_sequence_with_more_than_there_are_images() -> None:
    assert times("frame,time\n6,10.5\n3,10.25\n4,10.3\n5,1\n") == [10.25, 10.3, 10.5]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("frame\n3\n", "found no time"),
        ("frame,time\n3,1\n", "expected a time for every depth image, found none for frame 4 and 1 more"),
        ("frame,time\n3,1\n4,\n6,3\n", "found none for frame 4"),
        ("frame,time\n3,1\n4,2\n6,2\n", "frame 6: expected increasing times, found 2 s after 2 s"),
    ],
)
def test_a_mistake_in_times_is_named(text: str, message: str) -> None:
    with pytest.raises(CaptureError, match=message):
        times(text)
