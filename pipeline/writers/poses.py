"""Poses at a constant rate with nothing missing: what animation formats hold, and captures do not."""

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

# Clocks whose steps differ by less than this share of a step count as even.
_EVEN_CLOCK = 0.02


@dataclass(frozen=True)
class Poses:
    """T poses of J joints, `rate` a second.

    skeleton: its offsets are those of the joints that do not move in their parents;
    translations: (T, J, 3) metres in the parent's frame, the root's in the world; rotations: (T, J, 4) child
    to parent, sign-continuous, the root's in the world; filled: values of joints that were not captured but
    interpolated between the frames around.
    """

    skeleton: Skeleton
    rate: float
    translations: Array
    rotations: Array
    filled: int = 0
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def rigid(cls, skeleton: Skeleton, rate: float, root: Array, rotations: Array) -> Poses:
        """Poses of a skeleton whose bones keep their lengths; root: (T, 3) metres in the world."""
        translations = np.broadcast_to(skeleton.offsets, (*rotations.shape[:2], 3)).copy()
        translations[:, 0] = root
        return cls(skeleton, rate, translations, rotations)

    def kinematics(self) -> tuple[Array, Array]:
        """World positions (T, J, 3) and world rotations (T, J, 4)."""
        return forward_kinematics(self.skeleton, self.translations, self.rotations)

    def clip(self) -> Clip:
        """The same as a clip of one pass, every joint tracked, from time 0."""
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
    """The poses of a converted clip of one pass; joints stand where the clip has them, to rounding.

    An uneven clock is brought to an even one at the clip's usual rate (`resample.resample`). A joint's gaps
    are interpolated, its ends held, and a joint that was never seen stays at its parent. KinemimicError for
    under two frames.
    """
    if clip.rotations is None:
        raise ValueError("the clip has no rotations: convert it first")
    if len(clip.times) < 2:
        raise KinemimicError(f"export: expected a pass of 2 frames or more, found {len(clip.times)}")
    missing = ~np.isfinite(clip.positions).all(axis=-1) | ~np.isfinite(clip.rotations).all(axis=-1)
    even, rate = _even(clip)
    assert even.rotations is not None  # noqa: S101 - the clip has them
    rotations = np.tile(IDENTITY, (len(even.times), len(clip.skeleton.names), 1))
    for joint, turns in enumerate(np.moveaxis(even.rotations, 1, 0)):
        found = _bridged(even.times, continuous(turns))
        if found is not None:
            rotations[:, joint] = normalize(found)
    if even.translations is not None:
        translations = np.stack(
            [_held(even.times, place) for place in np.moveaxis(even.translations, 1, 0)], axis=1
        )
        translations[:, 0] = rotate(clip.world_from_file, translations[:, 0])
        skeleton = clip.skeleton
    else:
        translations, skeleton = _hung(even, rotations)
    return Poses(
        skeleton, rate, translations, continuous(rotations), int(missing.sum()), dict(clip.provenance)
    )


def _even(clip: Clip) -> tuple[Clip, float]:
    """The clip at a constant step, and its rate: as it is if its clock is even, else at its usual rate."""
    steps = np.diff(clip.times)
    usual = float(np.median(steps))
    if np.ptp(steps) <= _EVEN_CLOCK * usual:
        return clip, len(steps) / float(clip.times[-1] - clip.times[0])
    return resample(clip, 1.0 / usual), 1.0 / usual


def _bridged(times: Array, values: Array) -> Array | None:
    """Values (T, K) with straight lines in place of NaN, the ends held; None where all are missing."""
    seen = np.isfinite(values).all(axis=-1)
    if not seen.any():
        return None
    if seen.all():
        return values
    return np.stack([np.interp(times, times[seen], column) for column in values[seen].T], axis=-1)


def _held(times: Array, values: Array) -> Array:
    found = _bridged(times, values)
    return np.zeros_like(values) if found is None else found


def _hung(clip: Clip, rotations: Array) -> tuple[Array, Skeleton]:
    """Places of the joints in their parents' frames (N, J, 3), and the skeleton with their medians."""
    parents = clip.skeleton.parents
    places: list[Array] = []
    world: list[Array] = []
    translations = np.zeros((len(clip.times), len(parents), 3))
    for joint, parent in enumerate(parents):
        found = _bridged(clip.times, clip.positions[:, joint])
        if parent < 0:
            places.append(np.zeros((len(clip.times), 3)) if found is None else found)
            world.append(rotations[:, joint])
            translations[:, joint] = places[joint]
            continue
        places.append(places[parent] if found is None else found)
        world.append(multiply(world[parent], rotations[:, joint]))
        translations[:, joint] = rotate(conjugate(world[parent]), places[joint] - places[parent])
    offsets = np.median(translations, axis=0)
    offsets[0] = 0.0
    return translations, Skeleton(clip.skeleton.names, parents, offsets)
