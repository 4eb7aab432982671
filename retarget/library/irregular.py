"""Gaits whose strides differ, as in every recording, and more in those of a depth sensor.

A tracker that has learned only from loops falls within two seconds when it follows an unedited capture of a
depth sensor: no two strides are alike, and joints and path are off by degrees and centimetres.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import continuous, from_rotvec, multiply, normalize
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.retarget.humanoid.limits import LIMITS, clamp_to_limits
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.optimise.refine import refine

SECONDS = (4.0, 6.0)
STRENGTH = (0.3, 2.0)  # factor on all deviations
TEMPO = 0.10  # standard deviation of the pace, as a share
# Standard deviations about X, Y, Z in rad: about half of those between the strides of a Kinect v1's walks.
JOINTS = {
    "hip_center": (0.01, 0.01, 0.06),
    "spine": (0.015, 0.03, 0.02),
    "hip": (0.03, 0.06, 0.01),
    "knee": (0.0, 0.09, 0.0),
    "ankle": (0.03, 0.05, 0.01),
    "shoulder": (0.2, 0.2, 0.3),
    "elbow": (0.0, 0.25, 0.0),
}
PATH = (0.015, 0.015, 0.006)  # m
BANDWIDTH = (0.15, 0.5)  # s, standard deviation of the Gaussian that smooths the noise
# The same noise again, a sensor's, faster and smaller.
JITTER, JITTER_BANDWIDTH = (0.0, 0.8), (0.03, 0.08)


def irregular(loop: Motion, random: np.random.Generator) -> Motion:
    """A loop that is walked or run for a few seconds, with strides that differ."""
    count = round(random.uniform(*SECONDS) * loop.rate)
    slow = random.uniform(*STRENGTH), loop.rate * random.uniform(*BANDWIDTH)
    fast = random.uniform(*JITTER), loop.rate * random.uniform(*JITTER_BANDWIDTH)

    def noise(deviations: Sequence[float]) -> Array:
        parts = (strength * _noise(count, len(deviations), width, random) for strength, width in (slow, fast))
        total: Array = np.array(deviations) * sum(parts)
        return total

    pace = np.exp(TEMPO * slow[0] * _noise(count, 1, slow[1], random)[:, 0])
    at = np.cumsum(pace) + random.uniform(0.0, len(loop.root))
    root, rotations = _at(loop, at)
    for joint, deviations in JOINTS.items():
        for name in (joint, f"{joint}_left", f"{joint}_right"):
            if (node := NODE_INDEX.get(name)) is not None:
                rotations[:, node] = multiply(rotations[:, node], from_rotvec(noise(deviations)))
    for joint in LIMITS:
        rotations[:, NODE_INDEX[joint]] = clamp_to_limits(joint, rotations[:, NODE_INDEX[joint]])
    root = root + noise(PATH)
    moved = Motion(
        rate=loop.rate,
        root=root - root[0] * [1.0, 1.0, 0.0],
        rotations=continuous(rotations),
        contacts=loop.contacts[np.round(at).astype(np.intp) % len(loop.root)],
        cyclic=False,
    )
    return refine(moved)


def _at(loop: Motion, at: Array) -> tuple[Array, Array]:
    """Hip centres and rotations of a loop at frames (T,) that need not be whole, linear in between."""
    low = np.floor(at).astype(np.intp)
    share, size = (at - low)[:, None], len(loop.root)
    roots = [loop.root[k % size] + (k // size)[:, None] * loop.cycle_offset for k in (low, low + 1)]
    first, second = (loop.rotations[k % size] for k in (low, low + 1))
    second = np.where(np.sum(first * second, axis=-1, keepdims=True) < 0.0, -second, second)
    turns = normalize(first + share[..., None] * (second - first))
    return roots[0] + share * (roots[1] - roots[0]), turns


def _noise(count: int, columns: int, width: float, random: np.random.Generator) -> Array:
    """Smooth noise (count, columns) with unit variance; width: of the smoothing, in frames."""
    margin = int(4 * width)
    white = random.standard_normal((count + 2 * margin, columns))
    smooth: Array = gaussian_filter1d(white, width, axis=0)[margin : margin + count]
    smooth *= np.sqrt(2.0 * np.sqrt(np.pi) * width)
    return smooth
