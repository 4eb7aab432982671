"""Small holes are filled, within one surface only."""

from __future__ import annotations

import numpy as np
import pytest
from samples.depth_scene import AZURE, plane

from kinemimic.pipeline.readers.depth.holes import MAX_PIXELS, fill

SLANTED = plane(AZURE, np.array([0.4, 0.1, 0.9]), 2.6)[200:300, 300:420].astype(np.float32)


def test_a_small_hole_is_filled_within_a_centimetre() -> None:
    image = SLANTED.copy()
    image[40:48, 50:58] = 0
    filled = fill(image)
    off = np.abs(filled - SLANTED)
    assert off[40:48, 50:58].max() < 0.01
    assert (filled[image > 0] == image[image > 0]).all()


def test_the_input_is_not_changed() -> None:
    image = SLANTED.copy()
    image[5, 5] = 0
    fill(image)
    assert image[5, 5] == 0


@pytest.mark.parametrize("across", ["row", "column", "corner"])
def test_a_hole_at_the_edge_of_a_body_stays(across: str) -> None:
    image = np.full((60, 60), 4.0, dtype=np.float32)
    body = {"row": np.s_[30:], "column": np.s_[:, 30:], "corner": np.s_[30:, 30:]}[across]
    image[body] = 2.5
    image[28:33, 28:33] = 0
    assert (fill(image) == image).all()


def test_of_two_holes_only_the_one_inside_a_surface_is_filled() -> None:
    image = np.full((60, 60), 4.0, dtype=np.float32)
    image[:, 30:] = 2.5
    image[20:24, 28:32] = 0
    image[20:24, 40:44] = 0
    filled = fill(image)
    assert (filled[20:24, 28:32] == 0).all()
    assert (filled[20:24, 40:44] == 2.5).all()


def test_large_holes_and_the_margin_stay() -> None:
    image = SLANTED.copy()
    side = int(np.sqrt(MAX_PIXELS)) + 1
    image[40 : 40 + side, 50 : 50 + side] = 0
    image[:4, 20:24] = 0
    image[-3:, -3:] = 0
    assert (fill(image) == image).all()


def test_nothing_known_is_nothing_filled() -> None:
    assert (fill(np.zeros((20, 20), dtype=np.float32)) == 0).all()
