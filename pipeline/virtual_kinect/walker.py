"""A person who walks or runs in front of the virtual Kinect, with strides that vary.

`person` makes one person's gait from the stock cycle: at a given speed, with left and right sides that
differ. `walk` takes strides of that gait, each of them a little different.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, rotate, to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.virtual_kinect.footing import follow_feet
from kinemimic.pipeline.virtual_kinect.subject import Gait, GroundTruth, observed_body, periodic_spline
from kinemimic.pipeline.virtual_kinect.variability import HINGES, Variability, draw_asymmetry, draw_strides

# Speeds (m/s) to which the stock motions can be brought.
SPEEDS = {"walk": (0.6, 1.8), "run": (2.5, 4.5)}
_SAMPLES = 240  # of a cycle, and per second of a pass
# The deviation of the pelvis' path is smoothed over this time (s), since a body has mass.
_INERTIA, _MARGIN = 0.1, 0.5
# How far joints swing in a longer step, in proportion to the step; a knee bends little more.
_SWING = {"hip": 1.0, "shoulder": 1.0, "knee": 0.25}
_OTHER_SWING = 0.5


def person(gait: Gait, levels: Variability, rng: np.random.Generator, speed: float | None = None) -> Gait:
    """The gait of one person: sides that differ, at a speed in m/s (None: that of the cycle)."""
    share, amplitudes, shapes = draw_asymmetry(_SAMPLES, levels, rng)
    phase = np.arange(_SAMPLES + 1) / _SAMPLES
    # The first step takes (1 + share) / 2 of the stride.
    knots = np.array([-0.5, 0.0, 0.5, 1.0, 1.5]) + share * np.array([0.5, 0.0, 0.5, 0.0, 0.5])
    source = np.asarray(PchipInterpolator(knots, [-0.5, 0.0, 0.5, 1.0, 1.5])(phase))
    middle = _middle(gait)
    vectors = (
        middle
        + amplitudes[:, None] * (gait.rotations(source) - middle)
        + np.concatenate([shapes, shapes[:1]])
    )
    own = _closed(gait, source, vectors)
    return own if speed is None else at_speed(own, speed)


def at_speed(gait: Gait, speed: float) -> Gait:
    """The gait at another speed in m/s: stride and cadence each change with its root, as people's do
    (Sekiya and Nagasaki 1998: their ratio is constant). The legs swing as far as the stride asks."""
    change = np.sqrt(speed / gait.speed)
    phase = np.arange(_SAMPLES + 1) / _SAMPLES
    middle, vectors = _middle(gait), gait.rotations(phase)
    names = (node.removesuffix("_left").removesuffix("_right") for node in NODES)
    share = np.array([_SWING.get(name, _OTHER_SWING) for name in names])[:, None]
    swing = change
    for _ in range(20):
        factor = 1.0 + share * (swing - 1.0)
        other = _closed(gait, phase, middle + factor * (vectors - middle))
        swing *= change * gait.stride / other.stride
    return replace(other, period=gait.period / change)


def _middle(gait: Gait) -> Array:
    """(20, 3): the rotation vectors about which a node swings: their mean, and of a knee or elbow, which does
    not bend the wrong way, the straightest."""
    vectors = gait.rotations(np.arange(_SAMPLES) / _SAMPLES)
    middle = vectors.mean(axis=0)
    for number, node in enumerate(NODES):
        if node.split("_")[0] in HINGES:
            middle[number] = vectors[np.argmin(np.abs(vectors[:, number, 1])), number]
    return np.asarray(middle)


def _closed(gait: Gait, source: Array, vectors: Array) -> Gait:
    """The cycle with other rotation vectors (T + 1, 20, 3) at the cycle's phases `source`, on its feet."""
    inertia = _INERTIA / gait.period * _SAMPLES
    root, rotations = follow_feet(gait, source, vectors, np.zeros(len(source)), inertia=inertia, closed=True)
    phase = np.linspace(0.0, 1.0, len(source))
    # What is left of a sideways step in every stride is the heading's, not the cycle's.
    advance = root[-1] - root[0]
    root = root - phase[:, None] * advance
    return replace(
        gait,
        stride=float(advance[0]),
        root=periodic_spline(phase, root[:-1]),
        rotations=periodic_spline(phase, to_rotvec(rotations)[:-1]),
    )


def walk(
    gait: Gait,
    elapsed: Array,
    *,
    start: Array,
    heading: float,
    phase: float,
    turn: float = 0.0,
    levels: Variability,
    rng: np.random.Generator,
) -> GroundTruth:
    """The motion at times (T,) in seconds after passing `start` (2,) with a heading (radians) and a phase
    (cycles).

    turn: radians per second by which the person means to turn.
    """
    # A margin on both sides, where the smoothing of the path has no neighbours.
    margin = int(_MARGIN * _SAMPLES)
    times = np.arange(-margin, round(elapsed[-1] * _SAMPLES) + margin + 1) / _SAMPLES
    strides = draw_strides(times, phase, gait.period, levels, rng)
    middle = _middle(gait)
    vectors = (
        middle + strides.amplitudes[..., None] * (gait.rotations(strides.phase) - middle) + strides.shapes
    )
    toward = heading + strides.heading + turn * times
    root, rotations = follow_feet(gait, strides.phase, vectors, toward, inertia=_INERTIA * _SAMPLES)
    sway = rotate(from_axis_angle("Z", toward[margin]), gait.root(strides.phase[margin]))
    root[:, :2] += start + sway[:2] - root[margin, :2]
    shown = observed_body(gait.skeleton, root, rotations, toward, strides.phase)
    return shown.at(margin + np.rint(elapsed * _SAMPLES).astype(np.intp))
