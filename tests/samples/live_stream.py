"""The frames of a walker whose truth is known, and what a live capture makes of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.live.capture import LiveCapture, Moment
from kinemimic.pipeline.live.frame import CapturedFrame, frame_of
from kinemimic.pipeline.readers.landmarks.joint_sets import JointSet
from samples.walker import walker

STEP = 1.0 / 30.0
CLIP = walker(seconds=2.6).clip
TIMES = CLIP.times - CLIP.times[0]


def frames(positions: Array = CLIP.positions, times: Array = TIMES) -> list[CapturedFrame]:
    return [frame_of(t, p) for t, p in zip(times, positions, strict=True)]


def played(
    sent: Sequence[CapturedFrame], capture: LiveCapture | None = None, until: float | None = None
) -> list[Moment | None]:
    """What comes out if every frame arrives at its time."""
    capture = capture or LiveCapture(step=STEP)
    out, k, n = list[Moment | None](), 0, 0
    until = sent[-1].time if until is None else until
    while n * STEP <= until:
        while k < len(sent) and sent[k].time <= n * STEP + 1e-9:
            capture.take(sent[k])
            k += 1
        out.append(capture.advance())
        n += 1
    return out


def in_layout(layout: JointSet, positions: Array) -> Array:
    """The points (J, 3) of a layout that shows these nodes (20, 3); others are at the hips."""
    points = np.tile(positions[0], (len(layout.joints), 1))
    for node, joints in layout.nodes.items():
        points[joints] = positions[N[node]]
    return points


def truth(moment: Moment) -> Array:
    """Positions (20, 3) of the walker at a moment."""
    at = [np.interp(moment.time, TIMES, column) for column in CLIP.positions.reshape(len(TIMES), -1).T]
    return np.array(at).reshape(20, 3)


def seen(moments: Sequence[Moment | None]) -> list[Moment]:
    return [one for one in moments if one is not None and one.shows_person]
