"""Skeletons that Qualisys exports, written here from the known walk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import qualisys_skeleton as sample
from samples import source_of

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers import recognise

FRAMES = 30
POINTS = 1000.0 * sample.places(FRAMES)


def read(text: str) -> Clip:
    return recognise.read_source(source_of(text, Path("walk_s_S1.tsv")))


@pytest.mark.parametrize("empty", ["", "-99999"])
def test_segments_are_joints_at_their_positions(empty: str) -> None:
    clip = read(sample.text(POINTS, empty=empty))
    nodes = list(sample.SEGMENTS.values())
    assert clip.provenance["format"] == "Qualisys skeleton TSV"
    assert set(clip.skeleton.names) <= set(nodes)
    assert {"hip_left", "knee_left", "ankle_right", "foot_right", "wrist_left"} <= set(clip.skeleton.names)
    expected = 1e-3 * POINTS[:, [nodes.index(node) for node in clip.skeleton.names]]
    np.testing.assert_allclose(clip.positions, expected, atol=1e-6)
    assert clip.rate == pytest.approx(sample.RATE)


def test_a_frame_without_a_skeleton_is_a_gap() -> None:
    points = POINTS.copy()
    points[7] = np.nan
    clip = read(sample.text(points))
    assert len(clip.times) == FRAMES
    assert np.isnan(clip.positions[7]).all()
    assert np.isfinite(clip.positions[[6, 8]]).all()


def test_local_positions_are_refused() -> None:
    with pytest.raises(CaptureError, match="expected REFERENCE GLOBAL, found LOCAL"):
        read(sample.text(POINTS, reference="LOCAL"))


def test_a_file_that_is_cut_off_is_flagged() -> None:
    clip = read("\n".join(sample.text(POINTS).split("\n")[:-6]) + "\n")
    kinds = {defect["rule"] for defect in clip.provenance["reading"]["defects"]}
    assert kinds == {"dropped_frames"}


def test_a_table_without_segments_is_refused() -> None:
    text = sample.text(POINTS)
    head, _, rest = text.partition("Frame\tTime\t")
    row = rest.split("\n", 1)[1]
    with pytest.raises(CaptureError, match="columns NAME, X, Y, Z"):
        read(f"{head}Frame\tTime\tQX\tQY\tQZ\tQW\n{row}")


def test_without_a_solver_and_with_blanks_and_a_scale() -> None:
    text = sample.text(POINTS).replace("SOLVER\tTheia Markerless\n", "").replace("\tX\t", "\tX \t")
    clip = read(text.replace("SCALE\t1.00000", "SCALE\t1.05"))
    np.testing.assert_array_equal(clip.positions, read(sample.text(POINTS)).positions)
    assert "SCALE 1.05 is not applied" in clip.provenance["reading"]["notes"]
