"""CAD-60 and CAD-120: positions between orientations, in millimetres; numbers of frames are times."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import cad as sample
from samples import source_of
from samples.motion import in_range, walk

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, NODE_INDEX, TRACKED
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.readers import recognise

PATH = Path("take.txt")
TAKE = next(iter(sample.files().values())).decode()


def read(text: str) -> Clip:
    return recognise.read_source(source_of(text, PATH))


def changed(line: int, column: int, value: str) -> str:
    """The take with another value, line and column from 1."""
    lines = TAKE.split("\n")
    cells = lines[line - 1].split(",")
    cells[column - 1] = value
    lines[line - 1] = ",".join(cells)
    return "\n".join(lines)


def test_the_written_walk_comes_back() -> None:
    clip = read(TAKE)
    assert clip.provenance["format"] == "CAD-60 and CAD-120 skeletons"
    assert np.allclose(clip.times, np.arange(1, 91) / 30)
    expected = in_range(walk(90))[:, [NODE_INDEX[node] for node in clip.skeleton.names]]
    assert np.abs(clip.positions - expected).max() < 1e-4
    sure = np.array([node != sample.UNSURE for node in clip.skeleton.names])
    assert (clip.states == np.where(sure, TRACKED, INFERRED)).all()


def test_the_body_is_whole_and_nobody_s_mirror_image() -> None:
    checked = check_capture(read(TAKE))
    assert not checked.defects
    nodes, states = to_nodes(checked.clip)
    assert np.isfinite(nodes).all()
    assert (states[:, NODE_INDEX["foot_left"]] < TRACKED).all()  # derived: NiTE has no toes


def test_a_missing_frame_is_a_gap_and_zeros_are_nobody() -> None:
    lines = TAKE.split("\n")
    numbers = lines[9].split(",")
    lines[9] = ",".join([numbers[0], *["0"] * 170, ""])
    del lines[4]
    clip = read("\n".join(lines))
    assert np.diff(clip.times).max() == pytest.approx(2 / 30)
    assert (clip.states[8] == MISSING).all()
    assert [defect["rule"] for defect in clip.provenance["reading"]["defects"]] == ["zero_frames"]


def test_without_its_last_line_the_rest_is_read() -> None:
    assert len(read(TAKE.replace("END\n", "")).times) == 90


@pytest.mark.parametrize(
    ("line", "column", "value", "says"),
    [
        (7, 1, "6.5", "line 7: expected a frame number, found 6.5"),
        (7, 15, "7", "line 7: expected a confidence from 0 to 1, found 7"),
        (7, 12, "9e9", "line 7: expected at most 100000 mm in X of head, found 9e.09"),
        (7, 12, "x", "line 7: expected a number, found 'x'"),
        (7, 12, "1,2", "line 7: expected 171 numbers, found 172"),
    ],
)
def test_damage(line: int, column: int, value: str, says: str) -> None:
    with pytest.raises(CaptureError, match=says):
        read(changed(line, column, value))


def test_a_cut_off_file() -> None:
    with pytest.raises(CaptureError, match=r"line 90: expected 171 numbers, found .*the file is cut off"):
        read(TAKE[:-500])


def test_other_tables_of_that_width_are_not_claimed() -> None:
    with pytest.raises(CaptureError, match="formats of that width: CAD-60 and CAD-120 skeletons"):
        read(
            "\n".join(",".join(f"{x:.3f}" for x in row) for row in np.random.default_rng(3).random((9, 171)))
        )
