"""Which path over the ground a walk has: the recorded one, or the one by the feet where they disagree."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from kinemimic.pipeline.arrays import Array, Mask
from kinemimic.pipeline.locomotion.path.odometry import FEET_ERROR, FootOdometry
from kinemimic.pipeline.locomotion.phase.frames import frames_between


@dataclass(frozen=True)
class GroundPath:
    """Where the speed of a bout comes from.

    source: "recorded" where the recorded path agrees with the feet; "feet" where the body stays in place
    while the feet carry it, as on a treadmill, before a camera that turns with the walker, or without a root
    (of a belt that the room shows, they give the speed of the belt: `belt`);
    "neither" where the body's path does not match its steps, as in steps to the side. disagreement:
    median distance per stride between both, over the length of the stride by the feet; velocity: (T, 2) m/s,
    the one that is used.
    """

    source: Literal["recorded", "feet", "neither"]
    disagreement: float
    velocity: Array


# Share of a stride's length by which a recorded path may differ from the feet: by optical recordings, whose
# feet alone are off by 5 %, and by depth sensors. Share of the feet's speed below which the body stays in
# place.
MAX_DISAGREEMENT = {True: 0.20, False: 0.35}
MAX_STRIDE_DISAGREEMENT = 0.35  # of a single stride of an optical recording
IN_PLACE = 0.5
# From the foot that agrees better: a sound leg beside a limping one agrees to 0.03; legs that a sensor
# exchanged, to 0.09.
MAX_ONE_FOOT = 0.06
MIN_STANCE_FRAMES = 5  # of one foot within a stride
_SLOW = 0.3  # m/s: at lower speeds, differences count as at this speed


def disagreements(root: Array, feet: FootOdometry, phase: Array, edges: Array, rate: float) -> Array:
    """Per stride (K, 3), the distance between recorded path and feet, the length of the path, both over that
    by feet, and the distance from the foot that agrees better, while it stands.

    A leg that limps is on the ground for a shorter part of the stride than is expected here; the other one
    carries the body.

    root: (T, 3) metres, the recorded middle of the hips; phase: (T,) cycles; edges: (K, 2) first and last
    phase of each stride; NaN for a stride without frames.
    """
    recorded = rate * np.gradient(root[:, :2], axis=0)
    out = np.full((len(edges), 3), np.nan)
    for k, (start, end) in enumerate(edges):
        mine = frames_between(phase, start, end)
        if mine.stop - mine.start < 2:
            continue
        by_feet, by_path = feet.velocity[mine].mean(axis=0), recorded[mine].mean(axis=0)
        speed = max(float(np.linalg.norm(by_feet)), _SLOW)
        apart = float(np.linalg.norm(by_path - by_feet)) / speed
        out[k] = apart, np.linalg.norm(by_path) / speed, apart
        for over, weights in zip(feet.single[:, mine], feet.weights[:, mine], strict=True):
            if np.count_nonzero(weights) < MIN_STANCE_FRAMES:
                continue
            by_foot, then = (np.average(one, axis=0, weights=weights) for one in (over, recorded[mine]))
            size = max(float(np.linalg.norm(by_foot)), _SLOW)
            out[k, 2] = min(out[k, 2], float(np.linalg.norm(then - by_foot)) / size)
    return out


def choose_path(root: Array, feet: FootOdometry, apart: Array, rate: float, *, precise: bool) -> GroundPath:
    """The recorded path where it agrees with the feet, or in an optical recording with one of them, else the
    feet.

    apart: of `disagreements`, of whole strides if there are any.
    """
    known = apart[np.isfinite(apart).all(axis=1)]
    recorded = rate * np.gradient(root[:, :2], axis=0)
    if not len(known):
        return GroundPath("neither", float("inf"), recorded)
    disagreement, moved, of_one_foot = np.median(known, axis=0).tolist()
    if disagreement < MAX_DISAGREEMENT[precise]:
        return GroundPath("recorded", disagreement, recorded)
    if moved < IN_PLACE:
        return GroundPath("feet", disagreement, feet.velocity)
    # A depth sensor may well show one of two feet so that it agrees by chance.
    if precise and of_one_foot < MAX_ONE_FOOT:
        return GroundPath("recorded", of_one_foot, recorded)
    return GroundPath("neither", disagreement, feet.velocity)


def steady_velocity(velocity: Array, phase: Array, speed: float) -> Array:
    """Forward velocity (T,) by the feet whose mean over each stride is the speed, if it hardly differs
    anyway.
    """
    mean, whole = stride_means(velocity, phase)
    if not whole.any() or float(np.std(mean[whole])) > FEET_ERROR * abs(speed):
        return velocity
    at = np.arange(len(phase))
    return np.asarray(velocity + np.mean(mean[whole]) - np.interp(at, at[whole], mean[whole]))


def stride_means(values: Array, phase: Array) -> tuple[Array, Mask]:
    """Means (T,) of values (T,) over the stride around each frame, and (T,) whether that is a whole one: a
    part of a stride has another mean.

    phase: (T,) cycles.
    """
    at = np.arange(len(phase))
    early, late = (np.interp(phase + shift, phase, at) for shift in (-0.5, 0.5))
    total = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]))])
    mean = (np.interp(late, at, total) - np.interp(early, at, total)) / np.maximum(late - early, 1.0)
    whole = np.interp(late, at, phase) - np.interp(early, at, phase) > 0.99
    return mean, whole
