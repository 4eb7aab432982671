"""The v1 recorder's text: its form, and the round trip through the reader."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from kinemimic.pipeline.kinematics.skeleton import MISSING, TRACKED
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect import nui_skl
from kinemimic.pipeline.writers.skl import write_skl

PLANE = np.array([0.0, 0.99862953, -0.05233596, 0.9])


@pytest.mark.parametrize("numbered", [True, False])
def test_written_files_are_read_back(tmp_path: Path, numbered: bool) -> None:
    rng = np.random.default_rng(0)
    positions, states = rng.normal(size=(5, 20, 3)), np.full((5, 20), TRACKED, dtype=np.uint8)
    states[2, 7], positions[2, 7] = MISSING, np.nan
    states[3, 4] = 1
    path = tmp_path / "a.skl"
    numbers = np.array([7, 8, 9, 11, 12]) if numbered else None
    write_skl(path, np.array([1000, 1032, 1068, 1132, 1168]), positions, states, PLANE, frame_numbers=numbers)
    clip = nui_skl.read(Source.open(path))
    np.testing.assert_allclose(clip.positions, positions, atol=1e-12)
    np.testing.assert_array_equal(clip.states, states)
    np.testing.assert_allclose(clip.times, [1.0, 1.032, 1.068, 1.132, 1.168])


def test_the_text_has_the_recorders_form(tmp_path: Path, captures: Path) -> None:
    positions, states = np.zeros((1, 20, 3)), np.full((1, 20), TRACKED, dtype=np.uint8)
    positions[0, 0] = [3.0, 0.25, 1.0]  # three metres ahead, a quarter to the left, one up
    states[0, 1], positions[0, 1] = MISSING, np.nan
    path = tmp_path / "a.skl"
    write_skl(path, np.array([1000]), positions, states, PLANE, frame_numbers=np.array([30]))
    lines = path.read_bytes().decode().split("\r\n")
    real = (captures / "kinect1_bernstein_skl" / "i1.skl").read_bytes().decode().split("\r\n", 1)[0]
    assert lines[0] == real
    words = lines[1].split("\t")
    assert words[:6] == ["1000", "30", "0.25", "1", "3", "2"]
    assert words[6:10] == ["0", "0.9", "0", "0"]  # a lost joint: the sensor's place over the floor
    assert len(words) == 86 and lines[2] == ""
