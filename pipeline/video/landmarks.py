"""BlazePose's landmark network: 33 points of a body in the image and in metres, with their visibility."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.video.decode import Image
from kinemimic.pipeline.video.network import Network
from kinemimic.pipeline.video.region import Region

SIDE = 256
COUNT = 33
# The network also gives the middle of the hips and a point on the body's circle: the next frame's region.
_CENTRE, _CIRCLE, _ALL = 33, 34, 39
_HEATMAP = 64
# Cells of the heat map about a point that refine it, and the least of its peaks (0 to 1) that can.
_REACH, _MIN_PEAK = 3, 0.5
MIN_PRESENCE = 0.5
# Sizes of its outputs: points with visibility and presence, person or not, heat maps, points in metres.
OUTPUTS: tuple[int, ...] = (_ALL * 5, 1, _HEATMAP * _HEATMAP * _ALL, _ALL * 3)


@dataclass(frozen=True)
class Landmarks:
    """33 points of a body in one frame.

    score: 0 to 1 that a person is there; pixels: (33, 2); world: (33, 3) metres about the middle of the hips,
    x to the right, y down, z away from the camera; visibility: (33,) 0 to 1; region: of the next frame.
    """

    score: float
    pixels: Array
    world: Array
    visibility: Array
    region: Region


class LandmarkNetwork:
    """Finds the landmarks of the person in a region."""

    def __init__(self, network: Network) -> None:
        self._network = network

    def __call__(self, image: Image, region: Region) -> Landmarks:
        """The landmarks of the person in `region` of an image (H, W, 3)."""
        outputs = {out.size: out for out in self._network.run(region.crop(image, SIDE) / 255.0)}
        points, score, heat, metres = (outputs[size].ravel().astype(np.float64) for size in OUTPUTS)
        values = points.reshape(_ALL, 5)
        shares = refined(values[:, :2] / SIDE, heat.reshape(_HEATMAP, _HEATMAP, _ALL))
        pixels = region.to_image(shares)
        world = metres.reshape(_ALL, 3)[:COUNT].copy()
        # The square may be turned, and the metres with it.
        world[:, :2] = world[:, :2] @ region.axes.T
        return Landmarks(
            score=float(score[0]),
            pixels=pixels[:COUNT],
            world=world,
            # Visible: within the image, and not hidden.
            visibility=_logistic(np.minimum(values[:COUNT, 3], values[:COUNT, 4])),
            region=Region.about(pixels[_CENTRE], pixels[_CIRCLE]),
        )


def refined(shares: Array, heat: Array) -> Array:
    """Points (N, 2) as shares of the square, moved to the heat maps' (H, W, N) centres of mass nearby.

    A point outside the map, or without a distinct peak, stays.
    """
    rows, columns, _ = heat.shape
    result = shares.copy()
    cells: NDArray[np.int64] = np.floor(shares * [columns, rows]).astype(np.int64)
    for k, (column, row) in enumerate(cells):
        if not (0 <= column < columns and 0 <= row < rows):
            continue
        y = np.arange(max(0, row - _REACH), min(rows, row + _REACH + 1))
        x = np.arange(max(0, column - _REACH), min(columns, column + _REACH + 1))
        weights = _logistic(heat[y[0] : y[-1] + 1, x[0] : x[-1] + 1, k])
        if weights.max() >= _MIN_PEAK:
            total = weights.sum()
            result[k] = (
                weights.sum(0) @ (x + 0.0) / total / columns,
                weights.sum(1) @ (y + 0.0) / total / rows,
            )
    return result


def _logistic(x: Array) -> Array:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(x, -60.0, 60.0))))
