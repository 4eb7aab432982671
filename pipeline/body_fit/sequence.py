"""Fit the body to a whole clip: through gaps, and in windows, so that memory stays small."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.body_fit.body import MEAN_HEIGHT, POINTS
from kinemimic.pipeline.body_fit.camera import SceneCamera, focal_of
from kinemimic.pipeline.body_fit.fit import FIRST_CAMERA_HEIGHT, Scene, WindowFit, fit_window
from kinemimic.pipeline.body_fit.observed import Observed
from kinemimic.pipeline.body_fit.settings import FitSettings
from kinemimic.pipeline.body_fit.terms import image_residuals

# Radians along the longer side of the image: the main camera of a phone, in a video.
DEFAULT_FIELD_OF_VIEW = float(np.radians(67.0))
# Seconds: a longer gap divides the clip; a shorter part is left out.
LONGEST_GAP, SHORTEST_PART = 0.5, 0.3
# Frames of a window, and of those that it shares with the next one.
WINDOW, OVERLAP = 900, 60


@dataclass(frozen=True)
class FittedBody:
    """The body over T frames.

    points: (T, P, 3) metres in the scene (Z up from the floor), in the order of POINTS, NaN in frames
    without the person; misfit: (T, P) distance from the point in the image in standard deviations, NaN where
    none is seen; scene: lengths and camera; height: metres, of the person; steps: Gauss-Newton steps.
    """

    points: Array
    misfit: Array
    scene: Scene
    height: float
    steps: int


def fit_body(
    observed: Observed,
    *,
    height: float | None = None,
    field_of_view: float | None = None,
    settings: FitSettings | None = None,
    advance: Callable[[int], object] = lambda _: None,
) -> FittedBody | None:
    """Fit the body to the points of a clip; None if no part of it shows a person for long enough.

    height: metres, by default MEAN_HEIGHT; field_of_view: radians along the longer side of the image, by
    default that of a phone, which the fit may then change a little; advance: called with the number of
    frames that were fitted.
    """
    known = field_of_view is not None
    settings = settings or FitSettings(focal_known=known)
    focal = focal_of(observed.size, field_of_view if field_of_view is not None else DEFAULT_FIELD_OF_VIEW)
    camera = SceneCamera(observed.size, focal, FIRST_CAMERA_HEIGHT)
    tall = MEAN_HEIGHT if height is None else height
    parts = _parts(observed)
    if not parts:
        return None
    points = np.full((len(observed.times), len(POINTS), 3), np.nan)
    misfit = np.full(points.shape[:2], np.nan)
    longest = max(parts, key=lambda part: part.stop - part.start)
    # The scene is found once, from the middle of the longest part.
    middle = (longest.start + longest.stop) // 2
    sample = slice(max(longest.start, middle - WINDOW // 2), min(longest.stop, middle + WINDOW // 2))
    found = fit_window(_bridged(observed[sample]), camera, tall, settings)
    steps = found.steps
    for part in parts:
        for window, kept in _windows(part):
            fitted = found
            if window != sample:
                fitted = fit_window(_bridged(observed[window]), camera, tall, settings, scene=found.scene)
                steps += fitted.steps
            inside = slice(kept.start - window.start, kept.stop - window.start)
            points[kept] = fitted.placed.points[inside]
            misfit[kept] = _misfit(fitted)[inside]
            advance(kept.stop - kept.start)
    return FittedBody(points, misfit, found.scene, tall, steps)


def _misfit(fitted: WindowFit) -> Array:
    residual, weight = image_residuals(fitted.evidence, fitted.placed, fitted.scene.camera)
    certainty = fitted.evidence.observed.certainty
    distance = np.linalg.norm(residual, axis=-1)
    # Without the share of certainty: how far the point is, not how much that counts.
    return np.where(weight > 0.0, distance / np.maximum(certainty, 1e-3), np.nan)


def seen_frames(observed: Observed) -> Mask:
    """(T,) whether a frame shows the person."""
    return np.asarray((observed.certainty > 0.0).any(axis=1))


def _parts(observed: Observed) -> list[slice]:
    """Parts without long gaps, each beginning and ending with a frame that shows the person."""
    frames = np.flatnonzero(seen_frames(observed))
    if not len(frames):
        return []
    ends = np.flatnonzero(np.diff(observed.times[frames]) > LONGEST_GAP)
    starts, stops = frames[np.r_[0, ends + 1]], frames[np.r_[ends, len(frames) - 1]] + 1
    return [
        slice(int(a), int(b))
        for a, b in zip(starts, stops, strict=True)
        if observed.times[b - 1] - observed.times[a] >= SHORTEST_PART
    ]


def _windows(part: slice) -> list[tuple[slice, slice]]:
    """Windows that cover a part, each with the frames that are kept of it."""
    length = part.stop - part.start
    if length <= WINDOW:
        return [(part, part)]
    count = -(-(length - OVERLAP) // (WINDOW - OVERLAP))
    starts = np.linspace(part.start, part.stop - WINDOW, count).round().astype(int)
    windows = [slice(int(start), int(start) + WINDOW) for start in starts]
    cuts = [(a.stop + b.start) // 2 for a, b in pairwise(windows)]
    return [
        (window, slice(start, stop))
        for window, start, stop in zip(windows, [part.start, *cuts], [*cuts, part.stop], strict=True)
    ]


def _bridged(observed: Observed) -> Observed:
    """The same, with places interpolated over frames without the person, whose certainty stays zero."""
    seen = seen_frames(observed)
    if seen.all():
        return observed
    pixels, world = observed.pixels.copy(), observed.world.copy()
    for values in (pixels.reshape(len(seen), -1), world.reshape(len(seen), -1)):
        for column in range(values.shape[1]):
            values[~seen, column] = np.interp(
                observed.times[~seen], observed.times[seen], values[seen, column]
            )
    return Observed(observed.times, pixels, observed.certainty, world, observed.size)
