"""The `Motion` type: a motion of the 20 nodes on the simulated body, the reference that a policy imitates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.store import content_hash
from kinemimic.pipeline.kinematics.angles import ANGLES, hip_flexion
from kinemimic.pipeline.kinematics.clip import forward_kinematics
from kinemimic.pipeline.kinematics.rotations import IDENTITY, rotate, to_rotvec
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, SIDES, node_skeleton
from kinemimic.retarget.humanoid.body import node_offsets


@dataclass(frozen=True)
class Motion:
    """T frames at a constant rate on the Table 1 body, ground at z = 0, starting at x = y = 0 along +X.

    rate: frames per second, not necessarily an integer (a cycle is divided into equal steps)
    root: (T, 3) position of the hip centre, metres
    rotations: (T, 20, 4) child to parent, sign-continuous, the root's in the world; all identity in the
        neutral standing pose with hanging arms; end nodes (head, hands, feet) stay at the identity
    contacts: (T, 2) True where the left, right foot is flat and still, not wherever it touches the ground
    cyclic: whether frame T continues at frame 0, displaced by `cycle_offset` (3,) metres
    offsets: (20, 3) of the nodes from their parents, metres
    provenance: JSON values, as in Clip

    ValueError for arrays of other shapes, and for missing values.
    """

    rate: float
    root: Array
    rotations: Array
    contacts: NDArray[np.bool_]
    cyclic: bool
    cycle_offset: Array = field(default_factory=lambda: np.zeros(3))
    offsets: Array = field(default_factory=node_offsets)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        """A line instead of the arrays."""
        advance = self.cycle_offset if self.cyclic else self.root[-1] - self.root[0]
        speed = float(np.hypot(advance[0], advance[1])) / self.duration if self.duration > 0.0 else 0.0
        return (
            f"Motion({'a loop' if self.cyclic else 'once'}, {self.duration:.2f} s, {speed:.2f} m/s"
            f"{', simulated' if self.simulated else ''})"
        )

    def __post_init__(self) -> None:
        frames = len(self.root)
        if self.root.shape != (frames, 3) or self.rotations.shape != (frames, len(NODES), 4):
            raise ValueError("root must be (T, 3) and rotations (T, 20, 4)")
        if self.contacts.shape != (frames, 2) or self.offsets.shape != (len(NODES), 3):
            raise ValueError("contacts must be (T, 2) and offsets (20, 3)")
        if not (np.isfinite(self.root).all() and np.isfinite(self.rotations).all()):
            raise ValueError("a motion has no missing values")

    @property
    def duration(self) -> float:
        """Duration in seconds, of one cycle if cyclic."""
        return (len(self.root) if self.cyclic else len(self.root) - 1) / self.rate

    @property
    def identity(self) -> str:
        """Content hash of everything that a policy is trained on, without provenance."""
        return content_hash(
            {
                "rate": np.array(self.rate),
                "root": self.root,
                "rotations": self.rotations,
                "offsets": self.offsets,
                "cyclic": np.array(self.cyclic),
                "cycle_offset": self.cycle_offset,
            }
        )

    @property
    def simulated(self) -> bool:
        """Whether the capture comes from the virtual Kinect."""
        return bool(self.provenance.get("simulated", False))

    def kinematics(self) -> tuple[Array, Array]:
        """World positions (T, 20, 3) and world rotations (T, 20, 4) of the nodes."""
        return node_kinematics(self.root, self.rotations, self.offsets)


def node_kinematics(root: Array, rotations: Array, offsets: Array) -> tuple[Array, Array]:
    """World positions (T, 20, 3) and world rotations (T, 20, 4) of the nodes.

    root: (T, 3) hip centre, metres; rotations: (T, 20, 4) local, the root's in the world; offsets: (20, 3) of
    the nodes from their parents, metres.
    """
    translations = np.broadcast_to(offsets, (len(root), *offsets.shape)).copy()
    translations[:, 0] = root
    return forward_kinematics(node_skeleton(offsets), translations, rotations)


def joint_angles(rotations: Array) -> dict[str, Array]:
    """Knee and hip flexion from local node rotations (..., 20, 4): name in `ANGLES` -> radians (...,).

    Knee: rotation about the lateral axis. Hip: direction of the thigh in the pelvis' sagittal plane. The same
    function serves the reference and the simulated humanoid.
    """
    curves: dict[str, Array] = {}
    down = np.array([0.0, 0.0, -1.0])
    for side in SIDES:
        curves[f"knee_{side}"] = to_rotvec(rotations[..., NODE_INDEX[f"knee_{side}"], :])[..., 1]
        thigh = rotations[..., NODE_INDEX[f"hip_{side}"], :]
        curves[f"hip_{side}"] = hip_flexion(
            np.broadcast_to(IDENTITY, thigh.shape), np.zeros(3), rotate(thigh, down)
        )
    return {name: curves[name] for name in ANGLES}


def angles_at(motion: Motion, phase: Array) -> dict[str, Array]:
    """`joint_angles` of a motion at phases (M,), interpolated linearly."""
    curves = joint_angles(motion.rotations)
    frames = len(motion.root)
    knots = np.arange(frames + 1) / frames if motion.cyclic else np.arange(frames) / (frames - 1)
    at = np.mod(phase, 1.0) if motion.cyclic else phase
    return {
        name: np.interp(at, knots, np.append(curve, curve[0]) if motion.cyclic else curve)
        for name, curve in curves.items()
    }
