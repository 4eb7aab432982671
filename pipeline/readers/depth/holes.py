"""Fill small holes in a depth image from their surroundings, but never across the edge of a body."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.readers.depth.frames import Depth

# Larger holes are shadows and black clothes, where depth is unknown. 100 pixels are 11 across: 7 cm for an
# Azure Kinect at 3 m.
MAX_PIXELS = 100  # pixels
# Neighbours further apart than this (metres) belong to two objects; a surface tilted by 70° stays below it
# across a joint's window.
EDGE_STEP = 0.10
_NEIGHBOURS = [(row, column) for row in (0, 1, 2) for column in (0, 1, 2) if (row, column) != (1, 1)]


def fill(depth: Depth) -> Depth:
    """The image (H, W) in metres with its small holes (0) filled from their rims inwards.

    A hole is filled if it has at most MAX_PIXELS pixels, lies entirely inside the image, and the depths along
    its rim differ by at most EDGE_STEP: then it is a hole in one surface. A pixel gets the median of those of
    its eight neighbours that have a reading.
    """
    count, labels, stats, _ = cv2.connectedComponentsWithStats((depth == 0).astype(np.uint8), connectivity=8)
    left, top, width, height, area = stats[:, :5].T
    candidates = (area <= MAX_PIXELS) & (left > 0) & (top > 0)
    candidates &= (left + width < depth.shape[1]) & (top + height < depth.shape[0])
    candidates[0] = False  # all pixels with a reading
    filled = np.pad(depth, 1)
    rows, columns = np.nonzero(candidates[labels])
    label = np.asarray(labels)[rows, columns]
    neighbours = _neighbours(filled, rows, columns)
    has_reading = neighbours > 0
    nearest, farthest = np.full(count, np.inf), np.zeros(count)
    np.minimum.at(nearest, label, np.where(has_reading, neighbours, np.inf).min(axis=0))
    np.maximum.at(farthest, label, neighbours.max(axis=0))
    on_one_surface = (farthest - nearest <= EDGE_STEP)[label]
    rows, columns = rows[on_one_surface], columns[on_one_surface]
    while len(rows):
        neighbours = _neighbours(filled, rows, columns)
        rim = (neighbours > 0).any(axis=0)
        values = np.where(neighbours > 0, neighbours, np.nan)[:, rim]
        filled[rows[rim] + 1, columns[rim] + 1] = np.nanmedian(values, axis=0)
        rows, columns = rows[~rim], columns[~rim]
    return filled[1:-1, 1:-1]


def _neighbours(padded: Depth, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Depth:
    """Values (8, N) around pixels of an image with a margin of one pixel."""
    return np.stack([padded[rows + row, columns + column] for row, column in _NEIGHBOURS])
