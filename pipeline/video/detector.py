"""BlazePose's detector of people: anchors, letterbox, decoding, and suppression of duplicates.

The network sees the whole image in a square of 224 pixels and gives, for each of 2,254 anchors, a score, a
box (of the face) and four points, of which two tell where the body is: the middle of the hips, and a point on
the circle about it that holds the whole body.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.video.decode import Image
from kinemimic.pipeline.video.network import Network

SIDE = 224
# Numbers of its outputs: 12 and a score for each anchor.
OUTPUTS: tuple[int, ...] = (2254 * 12, 2254)
# Pixels between anchors per layer of the network, and the anchors at each place: two per layer.
_STRIDES: tuple[tuple[int, int], ...] = ((8, 2), (16, 2), (32, 6))
_CENTRE, _CIRCLE = 2, 3  # pairs of coordinates after the box's: the middle of the hips, the body's circle
_MAX_LOGIT = 100.0
MIN_SCORE = 0.5
# Boxes that overlap by more (intersection over union) are one person.
_MAX_OVERLAP = 0.3


@dataclass(frozen=True)
class Detection:
    """A person: score 0 to 1, and in the image's pixels box (x0, y0, x1, y1) of the face, centre (2,) of the
    hips, and circle (2,), a point whose distance from the centre is the radius of the body."""

    score: float
    box: Array
    centre: Array
    circle: Array

    @property
    def radius(self) -> float:
        """Pixels."""
        return float(np.linalg.norm(self.circle - self.centre))


def anchors() -> Array:
    """Centres (2254, 2) of the anchors as shares of the square, in the order of the network's output."""
    layers = []
    for stride, count in _STRIDES:
        cells = SIDE // stride
        rows, columns = np.divmod(np.arange(cells * cells), cells)
        centres = (np.column_stack([columns, rows]) + 0.5) / cells
        layers.append(np.repeat(centres, count, axis=0))
    return np.concatenate(layers)


class Detector:
    """Finds all people in an image."""

    def __init__(self, network: Network) -> None:
        self._network, self._anchors = network, anchors()

    def people(self, image: Image) -> list[Detection]:
        """The people in an image (H, W, 3), largest first."""
        square, scale, offset = letterbox(image)
        outputs = self._network.run(square / 127.5 - 1.0)
        numbers = next(out for out in outputs if out.shape[-1] != 1)[0].astype(np.float64)
        logits = next(out for out in outputs if out.shape[-1] == 1)[0, :, 0].astype(np.float64)
        scores = 1.0 / (1.0 + np.exp(-np.clip(logits, -_MAX_LOGIT, _MAX_LOGIT)))
        likely = np.flatnonzero(scores >= MIN_SCORE)
        centres = self._anchors[likely] * SIDE
        points = (numbers[likely].reshape(len(likely), 6, 2) + centres[:, None] * _IS_POINT) - offset
        points[:, 1] += offset  # width and height have no place
        points /= scale
        half = points[:, 1] / 2.0
        boxes = np.hstack([points[:, 0] - half, points[:, 0] + half])
        found = [
            Detection(float(scores[likely[k]]), boxes[k], points[k, _CENTRE], points[k, _CIRCLE])
            for k in suppressed(boxes, scores[likely])
        ]
        return sorted(found, key=lambda one: -one.radius)


# Of the pairs of an anchor's numbers, all but the second (width, height) are relative to the anchor.
_IS_POINT = np.array([1.0, 0.0, 1.0, 1.0, 1.0, 1.0])[:, None]


def letterbox(image: Image) -> tuple[Array, float, Array]:
    """The image scaled into a black square (1, 224, 224, 3) of red, green and blue; scale and offset (2,) in
    pixels: square = image * scale + offset."""
    height, width = image.shape[:2]
    scale = SIDE / max(height, width)
    offset = (SIDE - np.array([width, height]) * scale) / 2.0
    # OpenCV puts whole numbers at the centres of pixels, the network between them.
    matrix = np.array(
        [[scale, 0.0, offset[0] + 0.5 * scale - 0.5], [0.0, scale, offset[1] + 0.5 * scale - 0.5]]
    )
    small = cv2.warpAffine(
        image, matrix, (SIDE, SIDE), flags=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    )
    return small[None, :, :, ::-1].astype(np.float64), scale, offset


def suppressed(boxes: Array, scores: Array) -> list[int]:
    """Indices of boxes (N, 4), best first, without those that overlap a better one."""
    left = list(np.argsort(-scores, kind="stable"))
    kept: list[int] = []
    while left:
        best = int(left.pop(0))
        kept.append(best)
        left = [k for k in left if _overlap(boxes[best], boxes[k]) <= _MAX_OVERLAP]
    return kept


def _overlap(a: Array, b: Array) -> float:
    shared = np.clip(np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2]), 0.0, None).prod()
    union = (a[2:] - a[:2]).prod() + (b[2:] - b[:2]).prod() - shared
    return float(shared / union) if union > 0.0 else 0.0
