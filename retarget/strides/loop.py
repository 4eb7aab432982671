"""The gait loop: all accepted frames pooled by phase into one Fourier series per joint.

Smoothing, averaging over strides and closing the loop are one weighted ridge regression. Weights are lower
for joints that the sensor only inferred and, by Tukey's biweight, for outliers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    conjugate,
    from_rotvec,
    multiply,
    to_rotvec,
)
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, SIDES
from kinemimic.pipeline.locomotion.bouts import Bout
from kinemimic.pipeline.locomotion.phase import fourier

STATE_WEIGHTS = np.array([0.0, 0.3, 1.0])  # of missing, inferred, tracked joints
LEG = ("knee", "ankle", "foot")
RIDGE = 1e-5
# Strides that share one straight advance. Over fewer strides the line would absorb part of the sway.
SECTION_STRIDES = 4.0
SMALLEST_FADE = 0.02  # weight of the first and last frame of a short bout
ARM_HARMONICS, TRUNK_HARMONICS = 3, 4
MIN_HARMONICS = 3  # of a node's rotation; with too few frames for them, the node gets no series
HINGE_CHAINS: dict[str, tuple[str, ...]] = {
    f"{hinge}_{side}": tuple(f"{joint}_{side}" for joint in joints)
    for side in SIDES
    for hinge, joints in (("knee", ("hip", "knee", "ankle")), ("elbow", ("shoulder", "elbow", "wrist")))
}
MIRROR_NODES: NDArray[np.intp] = np.array(
    [NODE_INDEX[name.replace("left", "*").replace("right", "left").replace("*", "right")] for name in NODES]
)


@dataclass(frozen=True)
class PooledFrames:
    """M frames of the usable strides of all bouts in the walker's axes: X ahead, Y left, Z up.

    phase: (M,) cycles; group: (M,) index of the section of a bout; times: (M,) seconds from the start of the
    bout, on a clock in which all strides take one period; positions: (M, 20, 3); weights: (M, 20) per node;
    frames: (M,) indices into the clip.
    """

    phase: Array
    group: NDArray[np.intp]
    times: Array
    positions: Array
    weights: Array
    frames: NDArray[np.intp]


@dataclass(frozen=True)
class Series:
    """A node's rotation: `mean` (4,), then a rotation vector as a Fourier series (1 + 2 h, 3)."""

    mean: Array
    coefficients: Array

    def rotations(self, phase: Array) -> Array:
        """Local rotations (N, 4) at phases (N,) in cycles."""
        return multiply(self.mean, from_rotvec(fourier.evaluate(self.coefficients, phase)))


@dataclass(frozen=True)
class Loop:
    """One average stride, with the person's own proportions.

    period: seconds; speed: m/s; root: (1 + 2 h, 3) series of the hip centre about its uniform advance;
    joints: node -> series.
    """

    period: float
    speed: float
    root: Array
    joints: dict[str, Series]

    def rotations(self, phase: Array) -> Array:
        """Local rotations (N, 20, 4) at phases (N,); the identity for nodes without a series."""
        out = np.tile(IDENTITY, (len(phase), len(NODES), 1))
        for name, series in self.joints.items():
            out[:, NODE_INDEX[name]] = series.rotations(phase)
        return out


def pool_strides(clip: Clip, bouts: Sequence[Bout]) -> PooledFrames:
    """Pool the usable strides of bouts of a clip on the 20 nodes; a leg counts in its own good strides
    only.
    """
    parts: dict[str, list[NDArray[Any]]] = {name: [] for name in PooledFrames.__dataclass_fields__}
    groups = 0
    for one in bouts:
        legs = one.leg_mask()
        used = legs.any(axis=1)
        p = one.positions[used]
        states = np.where(np.isfinite(p).all(axis=-1), clip.states[one.frames[used]], 0)
        weights = STATE_WEIGHTS[states]
        for k, side in enumerate(SIDES):
            for joint in LEG:
                weights[~legs[used, k], NODE_INDEX[f"{joint}_{side}"]] = 0.0
        phase = one.phase[used]
        if len(bouts) == 1:
            weights *= _faded(phase)[:, None]
        section = ((phase - one.phase[0]) / SECTION_STRIDES).astype(np.intp)
        parts["phase"].append(phase)
        parts["group"].append(groups + section)
        groups += int(section.max(initial=0)) + 1
        # Seconds in which all strides take one period.
        parts["times"].append((phase - one.phase[0]) * one.period)
        parts["positions"].append(p)
        parts["weights"].append(weights)
        parts["frames"].append(one.frames[used])
    return PooledFrames(**{name: np.concatenate(arrays) for name, arrays in parts.items()})


def _faded(phase: Array) -> Array:
    """Weights (M,) of the frames of a lone bout, at phases (M,).

    Of less than two strides, the end repeats a part of the beginning, and the two never agree: that part
    fades over from the one to the other, or the loop would jump where it begins and ends.
    """
    repeated = np.ptp(phase) - 1.0
    if not 0.0 < repeated < 1.0:
        return np.ones(len(phase))
    inside = np.minimum(phase - phase.min(), phase.max() - phase) / repeated
    return np.asarray(np.clip(inside, SMALLEST_FADE, 1.0))


def with_mirror(strides: PooledFrames) -> PooledFrames:
    """The strides and their mirror image half a cycle later, for a left-right symmetric loop."""
    image = replace(
        strides,
        phase=strides.phase + 0.5,
        group=strides.group + strides.group.max() + 1,
        positions=strides.positions[:, MIRROR_NODES] * np.array([1.0, -1.0, 1.0]),
        weights=strides.weights[:, MIRROR_NODES],
    )
    return PooledFrames(
        **{
            name: np.concatenate([getattr(strides, name), getattr(image, name)])
            for name in PooledFrames.__dataclass_fields__
        }
    )


def robust_fit(
    phase: Array, values: Array, harmonics: int, weights: Array, group: NDArray[np.intp], floor: float
) -> Array:
    """Series (1 + 2 harmonics, K) of values (M, K), by iteratively reweighted least squares.

    Tukey's biweight on the norm of a residual rejects outliers. Each group (M,) of frames, a section of a
    bout, is weighted by its inverse variance, since the far leg of a walk seen from the side is guesswork.
    floor: smallest scale of residuals, in the unit of the values.
    """
    seen = weights > 0
    # Frames without weight are left out for speed.
    x, y, prior = fourier.design(phase[seen], harmonics), values[seen], weights[seen]
    _, group = np.unique(group[seen], return_inverse=True)
    median = _GroupMedians(group)
    robust = prior
    for _ in range(8):
        residual = y - x @ fourier.solve(x, y, robust, RIDGE)
        norm = np.sqrt(np.einsum("mk,mk->m", residual, residual))
        scale = max(1.4826 * float(np.median(norm)), floor)
        robust = prior * np.maximum(1.0 - (norm / (4.685 * scale)) ** 2, 0.0) ** 2
        robust *= scale**2 / (scale**2 + 2.0 * median(norm)[group] ** 2)
    return fourier.solve(x, y, robust, RIDGE)


class _GroupMedians:
    """Medians of values (M,) over their groups (M,), which are numbered from 0 without gaps."""

    def __init__(self, group: NDArray[np.intp]) -> None:
        self._counts = np.bincount(group)
        order = np.argsort(group, kind="stable")
        first = np.cumsum(self._counts) - self._counts
        self._place = np.empty_like(order)
        self._place[order] = np.arange(len(group)) - np.repeat(first, self._counts)
        self._group = group

    def __call__(self, values: Array) -> Array:
        """Medians (G,) of values (M,)."""
        table = np.full((len(self._counts), int(self._counts.max())), np.inf)
        table[self._group, self._place] = values
        table.sort(axis=1)
        rows = np.arange(len(table))
        low, high = (self._counts - 1) // 2, self._counts // 2
        return np.asarray(0.5 * (table[rows, low] + table[rows, high]))


def mean_rotation(q: Array, weights: Array) -> Array:
    """Mean rotation (4,) of q (M, 4): the principal eigenvector of the weighted second moment, w >= 0."""
    moment = np.einsum("m,mi,mj->ij", weights, q, q)
    mean = np.linalg.eigh(moment)[1][:, -1]
    return np.asarray(mean if mean[3] >= 0 else -mean)


def fit_joint(strides: PooledFrames, local: Array, name: str, harmonics: int) -> Series | None:
    """Series of one node from its local rotations (M, 4); None if it was hardly ever seen.

    Few frames, such as one stride at 30 Hz, reduce `harmonics` so that each coefficient has two frames.
    """
    weights = strides.weights[:, [NODE_INDEX[node] for node in source_nodes(name)]].min(axis=1)
    finite = np.asarray(np.isfinite(local).all(axis=-1))
    weights = np.where(finite, weights, 0.0)
    harmonics = min(harmonics, (int((weights > 0).sum()) // 2 - 1) // 2)
    if harmonics < MIN_HARMONICS or weights.sum() < 3.0:
        return None
    q = np.where(finite[:, None], local, IDENTITY)
    mean = IDENTITY if name in HINGE_CHAINS else mean_rotation(q, weights)
    values = to_rotvec(multiply(conjugate(mean), q))
    if name in HINGE_CHAINS:
        values[:, [0, 2]] = 0.0
    coefficients = robust_fit(strides.phase, values, harmonics, weights, strides.group, np.radians(2.0))
    return Series(mean, coefficients)


def source_nodes(name: str) -> tuple[str, ...]:
    """Nodes whose positions determine a node's rotation, besides its parent."""
    if name in HINGE_CHAINS:
        return HINGE_CHAINS[name]
    chain = {"hip": "knee", "ankle": "foot", "shoulder": "elbow", "wrist": "hand"}
    joint, _, side = name.partition("_")
    if name == "hip_center":
        return ("hip_left", "hip_right", "spine")
    if name == "spine":
        return ("spine", "shoulder_center")
    if name == "shoulder_center":
        return ("shoulder_center", "head")
    if joint not in chain:
        return (name,)
    return name, f"{chain[joint]}_{side}"


def fit_root(strides: PooledFrames, harmonics: int) -> tuple[Array, float]:
    """Series (1 + 2 h, 3) of the hip centre about its uniform advance, and the speed of that advance in m/s.

    Each section has its own straight line: it starts elsewhere, and a sensor's floor is never quite level.
    Lines and the common series are fitted alternately, because a section is not a whole number of strides.
    """
    hips = strides.positions[:, [NODE_INDEX["hip_left"], NODE_INDEX["hip_right"]]]
    seen = np.isfinite(hips[..., 0])
    center = np.where(seen[..., None], hips, 0.0).sum(axis=1) / np.maximum(seen.sum(axis=1), 1)[:, None]
    weights = strides.weights[:, [NODE_INDEX["hip_left"], NODE_INDEX["hip_right"]]].min(axis=1)
    weights = np.where(seen.any(axis=-1), weights, 0.0)
    center = np.where(weights[:, None] > 0, center, 0.0)
    _, group = np.unique(strides.group, return_inverse=True)

    def sums(values: Array) -> Array:
        """Weighted sums (G, ...) of values (M, ...) over each section."""
        flat = (weights[:, None] * values.reshape(len(values), -1)).T
        return np.stack([np.bincount(group, column) for column in flat], axis=-1)

    amounts = np.maximum(sums(np.ones(len(group))), 1e-12)
    times = strides.times - (sums(strides.times) / amounts)[group, 0]
    spread = np.maximum(sums(times**2), 1e-12)
    series = np.zeros((1 + 2 * harmonics, 3))
    for _ in range(10):
        swaying = center - fourier.evaluate(series, strides.phase)
        slopes, middles = sums(times[:, None] * swaying) / spread, sums(swaying) / amounts
        residual = center - middles[group] - slopes[group] * times[:, None]
        series = robust_fit(strides.phase, residual, harmonics, weights, strides.group, 0.01)
        series[0] = 0.0
    series[0, 2] = np.average(middles[:, 2], weights=amounts[:, 0])
    return series, float(np.average(slopes[:, 0], weights=amounts[:, 0]))


def fit_loop(strides: PooledFrames, local: Array, period: float, *, leg: int) -> Loop:
    """The loop of pooled strides and their local rotations (M, 20, 4); leg: harmonics of the legs.

    Nodes that were hardly ever seen get no series.
    """
    joints: dict[str, Series] = {}
    for name in NODES:
        joint = name.partition("_")[0]
        if joint in ("hand", "foot", "head"):
            continue
        if name in ("hip_center", "spine", "shoulder_center"):
            harmonics = TRUNK_HARMONICS
        else:
            harmonics = leg if joint in ("hip", "knee", "ankle") else ARM_HARMONICS
        series = fit_joint(strides, local[:, NODE_INDEX[name]], name, harmonics)
        if series is not None:
            joints[name] = series
    root, speed = fit_root(strides, TRUNK_HARMONICS)
    return Loop(period=period, speed=speed, root=root, joints=joints)
