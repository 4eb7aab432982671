"""Small holes in a depth image, filled from around them, and never across the edge of a body."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.readers.depth.frames import Depth

# Larger holes are shadows and black clothes: what lies there is not known. 100 pixels are 11 across: 7 cm for
# an Azure Kinect at 3 m.
LARGEST = 100  # pixels
# Neighbours further apart than this lie on two things (metres); a surface that slants by 70° stays below it
# over a joint's window.
EDGE = 0.10
_AROUND = [(row, column) for row in (0, 1, 2) for column in (0, 1, 2) if (row, column) != (1, 1)]


def fill(depth: Depth) -> Depth:
    """The image (H, W) in metres with its small holes (0) filled, from their rims inward.

    A hole is filled if it has at most LARGEST pixels, lies wholly inside the image, and everything on its rim
    is within EDGE of depth: then it is a hole in one surface. A pixel gets the median of those of its eight
    neighbours that are known.
    """
    count, labels, stats, _ = cv2.connectedComponentsWithStats((depth == 0).astype(np.uint8), connectivity=8)
    left, top, width, height, area = stats[:, :5].T
    candidates = (area <= LARGEST) & (left > 0) & (top > 0)
    candidates &= (left + width < depth.shape[1]) & (top + height < depth.shape[0])
    candidates[0] = False  # what is known
    filled = np.pad(depth, 1)
    rows, columns = np.nonzero(candidates[labels])
    label = np.asarray(labels)[rows, columns]
    around = _neighbours(filled, rows, columns)
    known = around > 0
    nearest, farthest = np.full(count, np.inf), np.zeros(count)
    np.minimum.at(nearest, label, np.where(known, around, np.inf).min(axis=0))
    np.maximum.at(farthest, label, around.max(axis=0))
    kept = (farthest - nearest <= EDGE)[label]
    rows, columns = rows[kept], columns[kept]
    while len(rows):
        around = _neighbours(filled, rows, columns)
        rim = (around > 0).any(axis=0)
        values = np.where(around > 0, around, np.nan)[:, rim]
        filled[rows[rim] + 1, columns[rim] + 1] = np.nanmedian(values, axis=0)
        rows, columns = rows[~rim], columns[~rim]
    return filled[1:-1, 1:-1]


def _neighbours(padded: Depth, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Depth:
    """(8, N) values around pixels of an image with a margin of one pixel."""
    return np.stack([padded[rows + row, columns + column] for row, column in _AROUND])
