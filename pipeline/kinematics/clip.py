"""Clip: the data type of every capture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import IDENTITY, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import Skeleton

# Frames per block: a block's data stay in the processor's cache, and its intermediate arrays are small.
_BLOCK = 2048


@dataclass(frozen=True)
class Label:
    """A named part of a recording, as the recorder or an annotator marked it: seconds on the clip's clock,
    both inclusive.

    ValueError unless the name is not empty and start <= end, both finite.
    """

    name: str
    start: float
    end: float

    def __post_init__(self) -> None:
        if not self.name or not (np.isfinite([self.start, self.end]).all() and self.start <= self.end):
            raise ValueError(f"label {self.name!r} from {self.start:g} to {self.end:g} s")


@dataclass(frozen=True)
class Clip:
    """A recorded motion of T frames on a skeleton of J joints.

    times: (T,) seconds, strictly increasing.
    positions: (T, J, 3) metres in the world (Z up, X forward, Y left); NaN where missing.
    states: (T, J) 0 missing, 1 inferred, 2 tracked.
    passes: (T,) number of the pass (a period in which the subject is visible) from 0; -1 outside any pass.
    provenance: how it was made, in JSON values: source, format, sha256, simulated, command, config,
    versions, seed.

    A capture of rotations also has
    euler: (T, J, 3) radians, the file's own channels in the sequence of `orders`; zeros for a joint
    without channels;
    orders: (J,) intrinsic order such as "ZYX", or "" for a joint without rotation channels;
    translations: (T, J, 3) metres, position in the parent's frame (for the root, in the file's world);
    world_from_file: (4,) rotation from the file's world axes to ours;
    rests: (J, 4) rotation of each joint's frame in its parent's (the root's in the file's world) with all
    its channels at zero; None if every frame is then aligned with the file's axes, as in BVH.
    After `convert`, every clip has
    rotations: (T, J, 4) child to parent, sign-continuous; the root's is in our world. A capture of positions
    and quaternions has them from the start; NaN where the sensor gave none.
    Angles that the recorder computed itself are kept beside ours and never replace them:
    angles: curves (T,) in radians by name ("knee_left", …), flexion positive; NaN where missing.
    labels: parts of the recording that came with names, in the order of their file. They need not lie within
    the frames: a rule may drop frames, never a label.
    """

    skeleton: Skeleton
    times: Array
    positions: Array
    states: NDArray[np.uint8]
    passes: NDArray[np.int32]
    provenance: Mapping[str, Any] = field(default_factory=dict)
    euler: Array | None = None
    orders: tuple[str, ...] | None = None
    translations: Array | None = None
    world_from_file: Array = field(default_factory=IDENTITY.copy)
    rests: Array | None = None
    rotations: Array | None = None
    angles: Mapping[str, Array] | None = None
    labels: tuple[Label, ...] = ()

    def __repr__(self) -> str:
        """A line instead of the arrays."""
        recorder = self.provenance.get("format", "an unknown format")
        seconds = float(self.times[-1] - self.times[0]) if len(self.times) else 0.0
        return (
            f"Clip({len(self.times):,} frames in {seconds:.1f} s, {len(self.skeleton.names)} joints, "
            f"{recorder}{', simulated' if self.simulated else ''})"
        )

    def __post_init__(self) -> None:
        frames, joints = len(self.times), len(self.skeleton.names)
        shapes: dict[str, tuple[NDArray[Any] | None, tuple[int, ...]]] = {
            "positions": (self.positions, (frames, joints, 3)),
            "states": (self.states, (frames, joints)),
            "passes": (self.passes, (frames,)),
            "euler": (self.euler, (frames, joints, 3)),
            "translations": (self.translations, (frames, joints, 3)),
            "rotations": (self.rotations, (frames, joints, 4)),
            "rests": (self.rests, (joints, 4)),
            **{name: (curve, (frames,)) for name, curve in (self.angles or {}).items()},
        }
        for name, (array, shape) in shapes.items():
            if array is not None and array.shape != shape:
                raise ValueError(f"{name} must have shape {shape}, has {array.shape}")
        if (self.euler is None) != (self.orders is None):
            raise ValueError("euler and orders go together")
        if frames > 1 and not np.all(np.diff(self.times) > 0):
            raise ValueError("times must increase strictly")

    @property
    def rate(self) -> float:
        """Frames per second, from the median step."""
        return float(1.0 / np.median(np.diff(self.times))) if len(self.times) > 1 else 0.0

    @property
    def simulated(self) -> bool:
        """True for a recording of the virtual Kinect."""
        return bool(self.provenance.get("simulated", False))


def scaled(clip: Clip, factor: float) -> Clip:
    """The clip with all lengths multiplied by a factor."""
    skeleton = Skeleton(clip.skeleton.names, clip.skeleton.parents, clip.skeleton.offsets * factor)
    return replace(
        clip,
        skeleton=skeleton,
        positions=clip.positions * factor,
        translations=None if clip.translations is None else clip.translations * factor,
    )


def forward_kinematics(skeleton: Skeleton, translations: Array, rotations: Array) -> tuple[Array, Array]:
    """World positions (T, J, 3) and world rotations (T, J, 4) from local ones.

    translations: (T, J, 3) in the parent's frame, the root's in the world; rotations: (T, J, 4).
    """
    positions, world = np.empty_like(translations), np.empty_like(rotations)
    for start in range(0, max(len(translations), 1), _BLOCK):
        rows = slice(start, start + _BLOCK)
        local, turns, places, frames = translations[rows], rotations[rows], positions[rows], world[rows]
        for joint, parent in enumerate(skeleton.parents):
            if parent < 0:
                places[:, joint], frames[:, joint] = local[:, joint], turns[:, joint]
            else:
                places[:, joint] = places[:, parent] + rotate(frames[:, parent], local[:, joint])
                frames[:, joint] = multiply(frames[:, parent], turns[:, joint])
    return positions, world
