"""The reference motion at any phase, with velocities and targets, from dense tables."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, interp1d

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import (
    conjugate,
    continuous,
    from_rotvec,
    multiply,
    normalize,
    rotate,
    to_rotvec,
)
from kinemimic.retarget.humanoid.body import BODIES, BODY_CENTERS, BODY_NODES
from kinemimic.retarget.humanoid.motion import Motion, node_kinematics
from kinemimic.train.reference.dynamics import InverseDynamics, inverse_dynamics
from kinemimic.train.sim.world import BodyStates, Poses

_TABLE_RATE = 960.0  # Hz: linear steps between its rows err by less than 0.01 degrees on a run
_EFFORT_RATE = 120.0  # Hz of the torques, from accelerations over two of its steps
_LARGEST_SHARE = 0.7  # of a joint's torque limit for the feed-forward: the rest is for balance


class Reference:
    """A motion sampled by phase (0 to 1 over its duration, not wrapped).

    A cyclic motion continues indefinitely, advancing by its cycle offset; any other holds its last frame.
    """

    def __init__(self, motion: Motion, table_rate: float = _TABLE_RATE) -> None:
        self._motion = motion
        rows = max(2, round(self.duration * table_rate) + 1)
        phase = np.linspace(0.0, 1.0, rows)
        root, rotations = _resample(motion, phase)
        step = self.duration / (rows - 1)
        nodes, world = node_kinematics(root, rotations, motion.offsets)
        rotation = world[:, BODY_NODES]
        position = nodes[:, BODY_NODES] + rotate(
            rotation, np.broadcast_to(BODY_CENTERS, (rows, *BODY_CENTERS.shape))
        )
        joints = rotations[:, BODY_NODES[1:]]
        # Values that are read together are stored together: one row is one look-up.
        self._tables = {"root": root, "nodes": rotations}
        self._tables["bodies"] = np.concatenate(
            [
                position,
                self._rate(position, step, self.cycle_offset),
                self._turn(rotation, step, world=True),
                rotation,
            ],
            axis=-1,
        )
        speeds = self._turn(joints, step, world=False)
        self._tables["joints"] = np.concatenate([joints, speeds], axis=-1)
        self._phase = phase

    @property
    def duration(self) -> float:
        """Seconds, of one cycle if cyclic."""
        return self._motion.duration

    @property
    def cyclic(self) -> bool:
        """Whether the motion repeats itself."""
        return self._motion.cyclic

    @property
    def row_count(self) -> int:
        """Number of rows of the tables."""
        return len(self._phase)

    @property
    def cycle_offset(self) -> Array:
        """(3,) metres by which a cycle advances."""
        return self._motion.cycle_offset

    def of(self, indices: NDArray[np.intp]) -> Reference:
        """The reference of these environments of a batch."""
        return self

    def tables(self) -> dict[str, Array]:
        """All tables by name: rows (R, ...) at equidistant phases."""
        self._add_targets()
        return self._tables

    def _add_targets(self) -> None:
        """Table of `targets`, on demand: its inverse dynamics take longer than everything else."""
        if "targets" in self._tables:
            return
        joints, speeds = self._tables["joints"][..., 0:4], self._tables["joints"][..., 4:7]
        led = continuous(multiply(joints, from_rotvec(self._leads(self._phase))))
        self._tables["targets"] = np.concatenate([led, speeds], axis=-1)

    def _rate(self, values: Array, step: float, offset: Array) -> Array:
        if self.cyclic:
            before, after = values[-2:-1] - offset, values[1:2] + offset
            padded = np.concatenate([before, values, after])
            return np.asarray((padded[2:] - padded[:-2]) / (2.0 * step))
        return np.asarray(np.gradient(values, step, axis=0))

    def _turn(self, q: Array, step: float, *, world: bool) -> Array:
        """Angular velocity by central differences, in the world or in the rotating frame."""
        before, after = (q[-2:-1], q[1:2]) if self.cyclic else (q[:1], q[-1:])
        padded = np.concatenate([before, q, after])
        a, b = padded[:-2], padded[2:]
        change = to_rotvec(multiply(b, conjugate(a)) if world else multiply(conjugate(a), b))
        width = np.full(len(q), 2.0 * step)
        if not self.cyclic:
            width[[0, -1]] = step
        return np.asarray(change / width.reshape(-1, *([1] * (q.ndim - 1))))

    def _leads(self, phase: Array) -> Array:
        """`leads_at` at phases (N,), by interpolation between even ones."""
        at = np.linspace(0.0, 1.0, max(2, round(self.duration * _EFFORT_RATE) + 1))
        return np.asarray(interp1d(at, self.leads_at(at), axis=0)(phase))

    def leads_at(self, at: Array) -> Array:
        """Rotation vectors (N, 14, 3) at phases (N,) by which a target leads its joint, so that the stable
        PD's stiffness gives the torque of the motion."""
        limits, stiffness = (
            np.array([[getattr(body, name)] for body in BODIES[1:]]) for name in ("torque_limit", "stiffness")
        )
        torques = self.dynamics_at(at).torques
        return np.asarray(np.clip(torques, -_LARGEST_SHARE * limits, _LARGEST_SHARE * limits) / stiffness)

    def dynamics_at(self, at: Array) -> InverseDynamics:
        """Torques and forces of the motion at phases (N,)."""
        step = 1.0 / (_EFFORT_RATE * self.duration)
        first, last = at - step, at + step
        if not self.cyclic:
            # There is nothing before and after.
            first, last = np.maximum(first, 0.0), np.minimum(last, 1.0)
        # Without steering (`route.py`).
        before, now, after = (Reference.bodies(self, moment) for moment in (first, at, last))
        rate = 1.0 / ((last - first) * self.duration)[:, None, None]
        return inverse_dynamics(
            now, rate * (after.linear - before.linear), rate * (after.angular - before.angular)
        )

    def _sample(self, name: str, phase: Array) -> Array:
        """Rows (..., shape of a row) of a table at phases (...), interpolated linearly."""
        table = self._tables[name]
        fraction = phase - np.floor(phase) if self.cyclic else np.minimum(np.maximum(phase, 0.0), 1.0)
        place = fraction * (len(table) - 1)
        low = np.minimum(place.astype(np.intp), len(table) - 2)
        rows = table.reshape(len(table), -1)
        value, change = rows.take(low, axis=0), rows.take(low + 1, axis=0)
        change -= value
        change *= (place - low)[..., None]
        value += change
        return value.reshape(*phase.shape, *table.shape[1:])

    def _advance(self, positions: Array, phase: Array) -> None:
        """Add the offsets of completed cycles to positions (..., 3) or (..., 15, 3)."""
        if self.cyclic:
            laps = np.floor(phase).reshape(*phase.shape, *[1] * (positions.ndim - phase.ndim))
            positions += laps * self.cycle_offset

    def _stop(self, velocities: Array, phase: Array) -> None:
        """Zero velocities after the last frame of a non-cyclic motion."""
        if not self.cyclic:
            velocities[phase > 1.0] = 0.0

    def bodies(self, phase: Array) -> BodyStates:
        """The 15 bodies (..., 15, 3 or 4) at phases (...)."""
        row = self._sample("bodies", phase)
        self._advance(row[..., 0:3], phase)
        self._stop(row[..., 3:9], phase)
        return BodyStates(row[..., 0:3], normalize(row[..., 9:13]), row[..., 3:6], row[..., 6:9])

    def poses(self, phase: Array) -> Poses:
        """Complete states at phases (E,), for `World.reset`."""
        bodies = self.bodies(phase)
        joints, velocities = self.joints(phase)
        return Poses(
            self.root(phase),
            bodies.rotations[:, 0],
            bodies.linear[:, 0],
            bodies.angular[:, 0],
            joints,
            velocities,
        )

    def root(self, phase: Array) -> Array:
        """Hip centre (..., 3) at phases (...)."""
        root = self._sample("root", phase)
        self._advance(root, phase)
        return root

    def nodes(self, phase: Array) -> Array:
        """Local node rotations (..., 20, 4) at phases (...)."""
        return normalize(self._sample("nodes", phase))

    def joints(self, phase: Array) -> tuple[Array, Array]:
        """Joint rotations (..., 14, 4) and velocities (..., 14, 3) in the child's frame at phases (...)."""
        row = self._sample("joints", phase)
        self._stop(row[..., 4:7], phase)
        return normalize(row[..., 0:4]), row[..., 4:7]

    def targets(self, phase: Array) -> tuple[Array, Array]:
        """Targets of the stable PD, as in `joints`: rotations that lead the reference's so as to give the
        torques of the motion, and the reference's velocities."""
        self._add_targets()
        row = self._sample("targets", phase)
        self._stop(row[..., 4:7], phase)
        return normalize(row[..., 0:4]), row[..., 4:7]


def _resample(motion: Motion, phase: Array) -> tuple[Array, Array]:
    """Root and node rotations at phases (N,) by cubic splines, closed over the loop if cyclic."""
    root, rotations = motion.root, motion.rotations
    if not motion.cyclic:
        at = np.linspace(0.0, 1.0, len(root))
        return CubicSpline(at, root)(phase), normalize(CubicSpline(at, rotations)(phase))
    at = np.linspace(0.0, 1.0, len(root) + 1)
    drift = at[:, None] * motion.cycle_offset
    # The loop closes on the same rotation, possibly with the opposite sign; local ones are near the identity.
    level = np.concatenate([root, root[:1] + motion.cycle_offset]) - drift
    level[-1] = level[0]
    closed = np.concatenate([rotations, rotations[:1]])
    path = CubicSpline(at, level, bc_type="periodic")(phase) + phase[:, None] * motion.cycle_offset
    return path, normalize(CubicSpline(at, closed, bc_type="periodic")(phase))
