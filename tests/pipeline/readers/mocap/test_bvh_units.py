"""BVH whose angles, or whose path, are in another unit than the rest of the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from samples import bvh as sample
from samples import source_of

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers.mocap import bvh as reader

PATH = Path("walk.bvh")
TEXT = sample.files(150)["walk.bvh"].decode()
HEAD, _, TAIL = TEXT.partition("MOTION\n")
LINES = TAIL.rstrip("\n").split("\n")
# Of the root: its position, then its rotation; of all others, rotations.
NUMBERS = np.array([[float(word) for word in line.split()] for line in LINES[2:]])


def read(numbers: NDArray[np.float64]) -> Clip:
    rows = [" ".join(f"{value:.6f}" for value in row) for row in numbers]
    return reader.read(source_of("\n".join([f"{HEAD}MOTION", *LINES[:2], *rows]) + "\n", PATH))


def test_angles_in_radians() -> None:
    numbers = NUMBERS.copy()
    numbers[:, 3:] = np.radians(numbers[:, 3:])
    clip, truth = read(numbers), read(NUMBERS)
    np.testing.assert_allclose(clip.positions, truth.positions, atol=1e-4)
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["action"]) == ("wrong_units", "repaired")
    assert "the angles are radians" in defect["text"]


def test_somebody_who_stands_still_has_small_angles_in_degrees() -> None:
    """None exceeds three degrees, and the body sways by centimetres."""
    numbers = np.tile(NUMBERS[:1], (150, 1))
    sway = np.sin(np.linspace(0.0, 20.0, 150))[:, None]
    numbers[:, :3] += 2.0 * sway
    numbers[:, 3:] = 2.5 * sway * np.random.default_rng(2026).uniform(-1.0, 1.0, NUMBERS.shape[1] - 3)
    clip = read(numbers)
    assert clip.provenance["reading"]["defects"] == []
    assert clip.euler is not None
    knees = np.degrees(np.ptp(clip.euler[:, clip.skeleton.names.index("knee_left")], axis=0))
    assert knees.max() < 5.1


@pytest.mark.parametrize("factor", [0.01, 0.001, 10.0, 100.0])
def test_a_path_in_another_unit(factor: float) -> None:
    numbers = NUMBERS.copy()
    numbers[:, :3] *= factor
    clip, truth = read(numbers), read(NUMBERS)
    np.testing.assert_allclose(clip.positions, truth.positions, atol=2e-3 if factor < 1.0 else 1e-4)
    (defect,) = clip.provenance["reading"]["defects"]
    assert (defect["rule"], defect["action"]) == ("wrong_units", "repaired")
    assert f"times {1.0 / factor:g}" in defect["text"]


def test_a_path_from_the_origin_is_left_as_it_is() -> None:
    numbers = NUMBERS.copy()
    numbers[:, :3] -= numbers[0, :3]
    assert read(numbers).provenance["reading"]["defects"] == []
