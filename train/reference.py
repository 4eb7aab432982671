"""The reference as the simulation needs it: any time, with velocities, from dense tables."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from kinemimic.pipeline.clip import forward_kinematics
from kinemimic.pipeline.rotations import conjugate, multiply, normalize, rotate, to_rotvec
from kinemimic.pipeline.skeleton import node_skeleton
from kinemimic.retarget.body import BODIES, BODY_NODES
from kinemimic.retarget.motion import Motion
from kinemimic.train.world import BodyStates, Poses

Array = NDArray[np.float64]

_TABLE_RATE = 960.0  # Hz: linear steps between its rows err by less than 0.01 degrees on a run


class Reference:
    """A motion sampled by phase (0 to 1 over its duration, not wrapped).

    A cyclic motion goes on for ever, advancing by its cycle offset; any other holds its last frame.
    """

    def __init__(self, motion: Motion) -> None:
        self.cyclic = motion.cyclic
        self.duration = motion.duration
        self._offset = motion.cycle_offset
        rows = round(self.duration * _TABLE_RATE) + 1
        phase = np.linspace(0.0, 1.0, rows)
        root, rotations = _resample(motion, phase)
        step = self.duration / (rows - 1)
        centers = np.array([body.center for body in BODIES])
        translations = np.broadcast_to(motion.offsets, (rows, *motion.offsets.shape)).copy()
        translations[:, 0] = root
        nodes, world = forward_kinematics(node_skeleton(motion.offsets), translations, rotations)
        rotation = world[:, BODY_NODES]
        position = nodes[:, BODY_NODES] + rotate(rotation, np.broadcast_to(centers, (rows, *centers.shape)))
        joints = rotations[:, BODY_NODES[1:]]
        self._tables: dict[str, Array] = {
            "root": root,
            "nodes": rotations,
            "positions": position,
            "rotations": rotation,
            "linear": self._rate(position, step, self._offset),
            "angular": self._turn(rotation, step, world=True),
            "joints": joints,
            "joint_velocities": self._turn(joints, step, world=False),
        }

    def _rate(self, values: Array, step: float, offset: Array) -> Array:
        if self.cyclic:
            before, after = values[-2:-1] - offset, values[1:2] + offset
            padded = np.concatenate([before, values, after])
            return np.asarray((padded[2:] - padded[:-2]) / (2.0 * step))
        return np.asarray(np.gradient(values, step, axis=0))

    def _turn(self, q: Array, step: float, *, world: bool) -> Array:
        """Angular velocity by central differences, in the world or in the turning frame itself."""
        before, after = (q[-2:-1], q[1:2]) if self.cyclic else (q[:1], q[-1:])
        padded = np.concatenate([before, q, after])
        a, b = padded[:-2], padded[2:]
        change = to_rotvec(multiply(b, conjugate(a)) if world else multiply(conjugate(a), b))
        width = np.full(len(q), 2.0 * step)
        if not self.cyclic:
            width[[0, -1]] = step
        return np.asarray(change / width.reshape(-1, *([1] * (q.ndim - 1))))

    def _sample(self, name: str, phase: Array) -> Array:
        table = self._tables[name]
        fraction = phase - np.floor(phase) if self.cyclic else np.clip(phase, 0.0, 1.0)
        place = fraction * (len(table) - 1)
        low = np.minimum(place.astype(np.intp), len(table) - 2)
        weight = (place - low).reshape(*place.shape, *([1] * (table.ndim - 1)))
        value: Array = table[low] * (1.0 - weight) + table[low + 1] * weight
        if table.shape[-1] == 4:
            return normalize(value)
        if self.cyclic and name in ("root", "positions"):
            laps = np.floor(phase).reshape(*place.shape, *([1] * (table.ndim - 1)))
            value = value + laps * self._offset
        elif not self.cyclic and name in ("linear", "angular", "joint_velocities"):
            value = np.where((phase > 1.0).reshape(weight.shape), 0.0, value)
        return value

    def bodies(self, phase: Array) -> BodyStates:
        """The 15 bodies at phases (E,)."""
        return BodyStates(
            *(self._sample(name, phase) for name in ("positions", "rotations", "linear", "angular"))
        )

    def poses(self, phase: Array) -> Poses:
        """Full states at phases (E,), to set figures to."""
        rotations, linear, angular = (
            self._sample(name, phase)[:, 0] for name in ("rotations", "linear", "angular")
        )
        joints, velocities = self.joints(phase)
        return Poses(self.root(phase), rotations, linear, angular, joints, velocities)

    def root(self, phase: Array) -> Array:
        """Hip centre (..., 3) at phases (...)."""
        return self._sample("root", phase)

    def nodes(self, phase: Array) -> Array:
        """Local node rotations (..., 20, 4) at phases (...)."""
        return self._sample("nodes", phase)

    def joints(self, phase: Array) -> tuple[Array, Array]:
        """Joint rotations (..., 14, 4) and velocities (..., 14, 3) in the child's frame at phases (...)."""
        return self._sample("joints", phase), self._sample("joint_velocities", phase)


def _resample(motion: Motion, phase: Array) -> tuple[Array, Array]:
    """Root and node rotations at phases (N,) by cubic splines, closed over the loop if cyclic."""
    root, rotations = motion.root, motion.rotations
    if not motion.cyclic:
        at = np.linspace(0.0, 1.0, len(root))
        return CubicSpline(at, root)(phase), normalize(CubicSpline(at, rotations)(phase))
    at = np.linspace(0.0, 1.0, len(root) + 1)
    drift = at[:, None] * motion.cycle_offset
    # The loop closes on the same rotation, perhaps with the other sign; local ones stay near the identity.
    level = np.concatenate([root, root[:1] + motion.cycle_offset]) - drift
    level[-1] = level[0]
    closed = np.concatenate([rotations, rotations[:1]])
    path = CubicSpline(at, level, bc_type="periodic")(phase) + phase[:, None] * motion.cycle_offset
    return path, normalize(CubicSpline(at, closed, bc_type="periodic")(phase))
