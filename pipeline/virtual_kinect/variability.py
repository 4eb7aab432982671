"""How people deviate from one repeated cycle, at levels measured on optical recordings (CMU, 120 Hz).

People: the level, straight walks of a corpus of CMU clips, 02_01, 02_02, 05_01, 06_01 and 07_01 to 07_12:
16 clips of 4 subjects, 25 strides. Joint rotations are those of `kinematics.orientation`, about a heading
low-passed at 0.4 Hz. Strides are cut at four events of the ankles' distance along the walk (both extremes,
both zeros), and consecutive strides of 0.8 to 1.7 s within 15 % of the clip's speed are compared: 44 pairs,
11 of which share no stride. A difference of consecutive strides, over the root of 2, is a standard
deviation without slow drift. The difference of two curves is split into amplitude (the part along their
mean), posture (its own mean) and shape (the rest, whose autocorrelation falls to one half within 0.07 of a
cycle). Values are root mean squares. Walker: the same of 12 simulated people at the measured level, 40 s
each.

| | people | walker |
|---|---|---|
| stride time; speed of a stride | 2.3 % (by subject 1.4, 3.4, 2.8, 1.9); 2.8 % | 2.7 %; 3.0 % |
| direction, from stride to stride | 1.6 deg | 1.4 deg |
| hip: amplitude; posture, shape, mean of three axes | 3.8 %; 0.9, 1.3 deg | 3.8 %; 0.8, 1.3 deg |
| knee | 4.2 %; 0.6, 1.4 deg | 4.2 %; 0.6, 1.3 deg |
| pelvis | 12 %; 0.7, 0.9 deg | 12 %; 0.5, 1.0 deg |
| shoulder | 15 %; 1.8, 2.3 deg | 13 %; 1.8, 2.5 deg |
| left - right by person: step time | 1.7 % of a stride | 3.0 % |
| left - right: hip (of people, sagittal) | 4.8 %; 1.0, 1.5 deg | 5.1 %; 0.7, 0.6 deg |
| left - right: knee | 8.4 %; 1.5, 1.4 deg | 7.6 %; 2.2, 0.7 deg |

Most of a knee's deviation is timing: 0.85 % of a cycle times its slope, and 1.9 degrees. Clips of 3 strides
show no slow drift; in Kinect v1 walks (KinectGait, 70 walks of 41 people, runs of 7 strides) stride times
scatter by 4.5 % (median), consecutive ones by 3.8 %, which leaves 2.3 %, and twice that in speed, since
stride and cadence share its changes. How fast the drift is, and the variation of runs, of which the corpus'
clips hold one stride each, are not measured: runs get the levels of walks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODES

# What is drawn so that the walker varies as above: legs less than measured, since the pelvis and the standing
# feet move them too. By joint: standard deviations from stride to stride of the amplitude (a share), of the
# posture and of the shape (degrees, each axis).
_STRIDES: dict[str, tuple[float, float, float]] = {
    "hip_center": (0.12, 0.7, 0.9),
    "spine": (0.11, 0.6, 0.9),
    "shoulder_center": (0.43, 1.4, 1.0),
    "shoulder": (0.15, 1.5, 1.5),
    "elbow": (0.22, 1.5, 2.4),
    "hip": (0.033, 0.6, 0.7),
    "knee": (0.034, 0.7, 0.6),
}
# By joint: the left minus the right of a person, standard deviations of the same three.
_ASYMMETRY: dict[str, tuple[float, float, float]] = {
    "shoulder": (0.46, 4.3, 2.8),
    "elbow": (0.61, 8.2, 2.7),
    "hip": (0.045, 0.8, 1.0),
    "knee": (0.08, 2.2, 1.7),
}
HINGES = ("knee", "elbow")  # turn about Y only
# Cycles: standard deviation of the Gaussian that shapes are smoothed with, and of a change of stride.
_SHAPE_WIDTH = 0.04
_CHANGE = 0.2
_DRIFT_STRIDES = 5.0  # correlation of the slow drift
_MIN_AMPLITUDE = 0.2  # of an arm that hardly swings


@dataclass(frozen=True)
class Variability:
    """Standard deviations as drawn; what results is in the module's table.

    period: of a stride's duration, relative; step: of the difference between a person's left and right step,
    relative to the stride; speed: of the slow drift, relative; heading: of its change from stride to stride,
    radians; joints: factor on the deviations of joint angles, measured = 1.
    """

    period: float = 0.015
    step: float = 0.01
    speed: float = 0.046
    heading: float = np.radians(0.7)
    joints: float = 1.0

    @classmethod
    def measured(cls, factor: float) -> Variability:
        """`factor` times what was measured; 0: one exact cycle."""
        one = cls()
        return cls(*(factor * value for value in (one.period, one.step, one.speed, one.heading, one.joints)))


@dataclass(frozen=True)
class Strides:
    """Random strides of one pass.

    phase: (T,) cycles, increasing; amplitudes: (T, 20) factors, and shapes: (T, 20, 3) radians, of the nodes'
    rotation vectors; heading: (T,) radians.
    """

    phase: Array
    amplitudes: Array
    shapes: Array
    heading: Array


def draw_strides(
    times: Array, phase: float, period: float, levels: Variability, rng: np.random.Generator
) -> Strides:
    """The strides at evenly spaced times (T,) in seconds; the phase, in cycles, is that at time 0."""
    before = 3  # strides drawn ahead of time 0
    count = int(1.5 * (times[-1] - times[0]) / period) + 2 * before + 3
    drift = levels.speed * _autoregressive(count, rng)
    pace = 1.0 + np.repeat(-0.5 * drift, 2) + np.sqrt(2.0) * levels.period * rng.standard_normal(2 * count)
    knots = np.append(0.0, np.cumsum(0.5 * period * np.clip(pace, 0.5, 1.5)))
    cycles = np.arange(len(knots)) / 2.0
    first = float(PchipInterpolator(cycles, knots)(before + phase % 1.0))
    cycle = np.asarray(PchipInterpolator(knots, cycles)(times + first))

    table = levels.joints * _table(_STRIDES)
    amplitudes = 1.0 + table[0] * _changing(cycle, rng.standard_normal((count, len(NODES))))
    # The body takes longer strides when it is faster.
    amplitudes += 0.5 * _changing(cycle, drift[:, None])
    axes = (len(NODES), 3)
    posture = _changing(cycle, rng.standard_normal((count, *axes)))
    step = float(times[1] - times[0])
    shape = _smooth_noise(len(times), _SHAPE_WIDTH * period / step, axes, rng)
    shapes = (table[1][:, None] * posture + table[2][:, None] * shape) * _free_axes()
    turns = np.cumsum(levels.heading * rng.standard_normal(count))
    heading = np.asarray(PchipInterpolator(np.arange(count), turns)(cycle))
    offset = np.floor(phase) - before
    return Strides(
        cycle + offset,
        np.maximum(amplitudes, _MIN_AMPLITUDE),
        np.radians(shapes),
        heading - np.interp(0.0, times, heading),
    )


def draw_asymmetry(count: int, levels: Variability, rng: np.random.Generator) -> tuple[float, Array, Array]:
    """A person's left against right: share of the stride by which the left step is longer, amplitudes (20,)
    and shapes (count, 20, 3) of rotation vectors in radians at evenly spaced phases, half of the difference
    on either side."""
    table = levels.joints * _table(_ASYMMETRY)
    share = float(levels.step * rng.standard_normal())
    side = np.array([0.5 * (node.endswith("_left") - float(node.endswith("_right"))) for node in NODES])
    # In the mirror, a rotation about Y stays and the others change sign.
    sides = np.stack([np.abs(side), side, np.abs(side)], axis=-1)
    pair = [min(NODES.index(node), NODES.index(_other_side(node))) for node in NODES]
    drawn = rng.standard_normal(len(NODES))[pair]
    axes = (len(NODES), 3)
    posture = rng.standard_normal(axes)[pair]
    shape = _smooth_noise(count, _SHAPE_WIDTH * count, axes, rng, closed=True)[:, pair]
    shapes = (table[1][:, None] * posture + table[2][:, None] * shape) * sides * _free_axes()
    return share, np.maximum(1.0 + side * table[0] * drawn, _MIN_AMPLITUDE), np.radians(shapes)


def _other_side(node: str) -> str:
    swap = {"left": "right", "right": "left"}
    return "_".join(swap.get(word, word) for word in node.split("_"))


def _table(levels: dict[str, tuple[float, float, float]]) -> Array:
    """(3, 20): the three levels of every node, 0 of those not listed."""
    names = (node.removesuffix("_left").removesuffix("_right") for node in NODES)
    return np.array([levels.get(name, (0.0, 0.0, 0.0)) for name in names]).T


def _free_axes() -> Array:
    """(20, 3): 1 for the axes about which a node turns."""
    return np.array([
        [0.0, 1.0, 0.0] if node.split("_")[0] in HINGES else [1.0, 1.0, 1.0] for node in NODES
    ])  # fmt: skip


def _autoregressive(count: int, rng: np.random.Generator) -> Array:
    """(count,) of unit variance, one per stride, correlated over _DRIFT_STRIDES."""
    decay = np.exp(-1.0 / _DRIFT_STRIDES)
    values = rng.standard_normal(count)
    for k in range(1, count):
        values[k] = decay * values[k - 1] + np.sqrt(1.0 - decay**2) * values[k]
    return values


def _changing(cycle: Array, values: Array) -> Array:
    """Values (T, ...) of each stride (count, ...), with a smooth change from one stride to the next."""
    stride = np.floor(cycle).astype(int)
    # The change is centred on the stride's end: from half of _CHANGE before it to half of _CHANGE after.
    x = np.clip((cycle - np.round(cycle)) / _CHANGE + 0.5, 0.0, 1.0)
    weight = x * x * (3.0 - 2.0 * x)
    ending = np.round(cycle).astype(int)
    near = np.abs(cycle - ending) < 0.5 * _CHANGE
    low = np.where(near, ending - 1, stride)
    share = np.where(near, weight, 0.0).reshape(-1, *([1] * (values.ndim - 1)))
    return np.asarray((1.0 - share) * values[low] + share * values[np.minimum(low + 1, len(values) - 1)])


def _smooth_noise(
    count: int, width: float, axes: tuple[int, ...], rng: np.random.Generator, *, closed: bool = False
) -> Array:
    """(count, *axes) of unit variance: white noise under a Gaussian of `width` samples; closed:
    periodic."""
    pad = 0 if closed else int(np.ceil(4.0 * width))
    white: Array = rng.standard_normal((count + 2 * pad, *axes))
    noise = gaussian_filter1d(white, width, axis=0, mode="wrap" if closed else "reflect")
    return np.asarray(noise[pad : pad + count] * np.sqrt(2.0 * np.sqrt(np.pi) * width))
