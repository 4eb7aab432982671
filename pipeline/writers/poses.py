"""Poses at a constant rate with nothing missing, as animation formats require and captures lack."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.resample import resample
from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    conjugate,
    continuous,
    multiply,
    normalize,
    rotate,
)
from kinemimic.pipeline.kinematics.skeleton import TRACKED, Skeleton

# Time steps that differ by less than this share of a step count as constant.
_CONSTANT_STEP = 0.02


@dataclass(frozen=True)
class Poses:
    """T poses of J joints at `rate` Hz.

    skeleton: its offsets are those of the joints that do not move in their parents; translations: (T, J, 3)
    metres in the parent's frame, the root's in the world; rotations: (T, J, 4) child to parent,
    sign-continuous, the root's in the world; filled: number of joint values that were interpolated because
    they were not captured.
    """

    skeleton: Skeleton
    rate: float
    translations: Array
    rotations: Array
    filled: int = 0
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def rigid(cls, skeleton: Skeleton, rate: float, root: Array, rotations: Array) -> Poses:
        """Poses of a skeleton with constant bone lengths; root: (T, 3) metres in the world."""
        translations = np.broadcast_to(skeleton.offsets, (*rotations.shape[:2], 3)).copy()
        translations[:, 0] = root
        return cls(skeleton, rate, translations, rotations)

    def kinematics(self) -> tuple[Array, Array]:
        """World positions (T, J, 3) and world rotations (T, J, 4)."""
        return forward_kinematics(self.skeleton, self.translations, self.rotations)

    def clip(self) -> Clip:
        """The same as a clip of one pass from time 0, every joint tracked."""
        frames = len(self.rotations)
        return Clip(
            skeleton=self.skeleton,
            times=np.arange(frames) / self.rate,
            positions=self.kinematics()[0],
            states=np.full(self.rotations.shape[:2], TRACKED, dtype=np.uint8),
            passes=np.zeros(frames, dtype=np.int32),
            provenance=self.provenance,
            translations=self.translations,
            rotations=self.rotations,
        )


def poses_of_clip(clip: Clip) -> Poses:
    """The poses of a converted clip of one pass; joints are where the clip has them, within rounding.

    Irregular times are resampled at the clip's median rate (`resample.resample`). A joint's gaps are
    interpolated, its ends held, and a joint that was never seen is put at its parent. Raises KinemimicError
    for fewer than two frames.
    """
    if clip.rotations is None:
        raise ValueError("the clip has no rotations: convert it first")
    if len(clip.times) < 2:
        raise KinemimicError(f"export: expected a pass of 2 frames or more, found {len(clip.times)}")
    missing = ~np.isfinite(clip.positions).all(axis=-1) | ~np.isfinite(clip.rotations).all(axis=-1)
    regular, rate = _at_constant_rate(clip)
    assert regular.rotations is not None  # noqa: S101 - the clip has them
    rotations = np.tile(IDENTITY, (len(regular.times), len(clip.skeleton.names), 1))
    for joint, quaternions in enumerate(np.moveaxis(regular.rotations, 1, 0)):
        filled_values = _interpolated(regular.times, continuous(quaternions))
        if filled_values is not None:
            rotations[:, joint] = normalize(filled_values)
    if regular.translations is not None:
        translations = np.stack(
            [
                _interpolated_or_zero(regular.times, place)
                for place in np.moveaxis(regular.translations, 1, 0)
            ],
            axis=1,
        )
        translations[:, 0] = rotate(clip.world_from_file, translations[:, 0])
        skeleton = clip.skeleton
    else:
        translations, skeleton = _translations_from_positions(regular, rotations)
    return Poses(
        skeleton, rate, translations, continuous(rotations), int(missing.sum()), dict(clip.provenance)
    )


def _at_constant_rate(clip: Clip) -> tuple[Clip, float]:
    """The clip at a constant step, and its rate: unchanged if the steps are constant, else at the median
    rate."""
    steps = np.diff(clip.times)
    median_step = float(np.median(steps))
    if np.ptp(steps) <= _CONSTANT_STEP * median_step:
        return clip, len(steps) / float(clip.times[-1] - clip.times[0])
    return resample(clip, 1.0 / median_step), 1.0 / median_step


def _interpolated(times: Array, values: Array) -> Array | None:
    """Values (T, K) with NaN interpolated linearly and ends held; None if all are missing."""
    seen = np.isfinite(values).all(axis=-1)
    if not seen.any():
        return None
    if seen.all():
        return values
    return np.stack([np.interp(times, times[seen], column) for column in values[seen].T], axis=-1)


def _interpolated_or_zero(times: Array, values: Array) -> Array:
    filled_values = _interpolated(times, values)
    return np.zeros_like(values) if filled_values is None else filled_values


def _translations_from_positions(clip: Clip, rotations: Array) -> tuple[Array, Skeleton]:
    """Positions of the joints in their parents' frames (N, J, 3), and the skeleton with their medians."""
    parents = clip.skeleton.parents
    positions: list[Array] = []
    world: list[Array] = []
    translations = np.zeros((len(clip.times), len(parents), 3))
    for joint, parent in enumerate(parents):
        filled_values = _interpolated(clip.times, clip.positions[:, joint])
        if parent < 0:
            positions.append(np.zeros((len(clip.times), 3)) if filled_values is None else filled_values)
            world.append(rotations[:, joint])
            translations[:, joint] = positions[joint]
            continue
        positions.append(positions[parent] if filled_values is None else filled_values)
        world.append(multiply(world[parent], rotations[:, joint]))
        translations[:, joint] = rotate(conjugate(world[parent]), positions[joint] - positions[parent])
    offsets = np.median(translations, axis=0)
    offsets[0] = 0.0
    return translations, Skeleton(clip.skeleton.names, parents, offsets)
