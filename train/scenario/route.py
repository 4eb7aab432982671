"""Routes: a gait's reference, steered along a path with bends."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply, rotate
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.reference.reference import Reference
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.sim.world import BodyStates

_STEP = 0.01  # m between two rows of a route's table
_EASE = 0.6  # m over which a bend starts and ends: half a stride
_UP = np.array([0.0, 0.0, 1.0])


class Route:
    """A path on the ground from the origin, first along the x-axis.

    segments: (length in m, turn in rad to the left) in order, each with constant curvature; the curvature
    changes smoothly between them. Before and after the segments the path is straight.
    """

    def __init__(self, segments: Sequence[tuple[float, float]]) -> None:
        self.length = sum(length for length, _ in segments)
        count = round((self.length + 2.0 * _EASE) / _STEP) + 1
        self._start = -_EASE
        along = self._start + _STEP * np.arange(count)
        ends = np.cumsum([length for length, _ in segments])
        at = np.searchsorted(ends, along, side="right")
        # By the segment's rows, not its length, so that they sum to exactly its turn.
        rows = np.maximum(np.bincount(at[along >= 0.0], minlength=len(segments)), 1)
        bends = np.array([turn / (rows[k] * _STEP) for k, (_, turn) in enumerate(segments)] + [0.0])
        sharp = np.where(along < 0.0, 0.0, bends[at])
        width = round(_EASE / _STEP)
        self._bend = np.convolve(sharp, np.full(width, 1.0 / width), mode="same")
        self._heading = _integral(self._bend)
        self._points = np.stack([_integral(np.cos(self._heading)), _integral(np.sin(self._heading))], axis=-1)
        origin = round(-self._start / _STEP)
        self._points -= self._points[origin]

    def at(self, distance: Array) -> tuple[Array, Array, Array]:
        """Points (..., 2), headings (...) in rad and curvature (...) in rad/m at distances (...) along the
        path."""
        last = self._start + _STEP * (len(self._bend) - 1)
        inside = np.clip(distance, self._start, last)
        table = self._start + _STEP * np.arange(len(self._bend))
        heading, bend = (np.interp(inside, table, column) for column in (self._heading, self._bend))
        points = np.stack([np.interp(inside, table, column) for column in self._points.T], axis=-1)
        straight = (distance - inside)[..., None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
        return points + straight, heading, np.where(distance == inside, bend, 0.0)


def _integral(values: Array) -> Array:
    """Integral (N,) by the trapezoidal rule, from 0."""
    return np.concatenate([[0.0], np.cumsum(0.5 * _STEP * (values[1:] + values[:-1]))])


class SteeredReference(Reference):
    """A reference along the x-axis, bent onto a route: its x since phase 0 is the distance along the route,
    its sway is lateral to it, and its heading follows it. The joints do not change."""

    def __init__(self, motion: Motion, route: Route) -> None:
        super().__init__(motion)
        if not motion.cyclic or abs(motion.cycle_offset[1]) >= 0.05 * motion.cycle_offset[0]:
            raise KinemimicError(
                "expected a straight walk or run to steer along the scenario's route, found another motion; "
                "make one with `kinemimic retarget --straighten`"
            )
        self._route = route

    def bodies(self, phase: Array) -> BodyStates:
        straight, root = super().bodies(phase), super().root(phase)
        speed = np.asarray(straight.linear[..., 0, :])
        points, heading, bend = self._route.at(root[..., 0])
        turn = from_axis_angle("Z", heading)[..., None, :]
        base = np.concatenate([points, np.zeros((*points.shape[:-1], 1))], axis=-1)[..., None, :]
        along = root * [1.0, 0.0, 0.0]
        arms = rotate(turn, straight.positions - along[..., None, :])
        yaw = (bend * speed[..., 0])[..., None, None] * _UP
        return BodyStates(
            base + arms,
            multiply(np.broadcast_to(turn, straight.rotations.shape), straight.rotations),
            rotate(turn, straight.linear) + np.cross(np.broadcast_to(yaw, arms.shape), arms),
            rotate(turn, straight.angular) + yaw,
        )

    def root(self, phase: Array) -> Array:
        straight = super().root(phase)
        points, heading, _ = self._route.at(straight[..., 0])
        beside = rotate(from_axis_angle("Z", heading), straight * [0.0, 1.0, 1.0])
        beside[..., :2] += points
        return beside

    def nodes(self, phase: Array) -> Array:
        nodes = super().nodes(phase)
        _, heading, _ = self._route.at(super().root(phase)[..., 0])
        nodes[..., 0, :] = multiply(from_axis_angle("Z", heading), nodes[..., 0, :])
        return nodes


def reference_for(motion: Motion, scenario: Scenario | None) -> Reference:
    """The reference of a motion in a scenario: steered if the scenario has a route."""
    if scenario is None or not scenario.route:
        return Reference(motion)
    return SteeredReference(motion, Route(scenario.route))
