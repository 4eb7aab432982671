"""A reference that grows while it is followed: the frames of a live capture, and a prediction of the next."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import continuous, from_rotvec, multiply
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.world import CONTROL_RATE, BodyStates, Poses

KNOWN = 1  # frames ahead of the present that have come: the coming control step ends at the newest
AHEAD = 13  # frames ahead that a tracker sees: its preview of 12 control steps, after the coming one
BEHIND = 6  # frames before the present, which the splines through the present need
MEMORY = 31  # frames from which the next are predicted: more than the largest of PAST and NOISY_PAST
_ROWS = 8  # of the tables for each frame, for as many torques as substeps
RATE = float(CONTROL_RATE)
# Of the last MEMORY frames, (F, 3) and (F, 20, 4), their noise, 0 to 1, and whether the person stays on the
# spot, 0 to 1: the newest frame without noise, and the AHEAD - KNOWN that follow.
Predict = Callable[[Array, Array, float, float], tuple[Array, Array]]


class _Stretch(Reference):
    """The last frames and the predicted ones; torques are found for the coming control step alone."""

    def __init__(self, motion: Motion) -> None:
        super().__init__(motion, RATE * _ROWS)

    def _add_targets(self) -> None:
        if "targets" in self._tables:
            return
        table = self._tables["joints"]
        joints, speeds = table[..., 0:4], table[..., 4:7]
        rows = slice(BEHIND * _ROWS, (BEHIND + 1) * _ROWS + 1)
        led = joints.copy()
        led[rows] = multiply(joints[rows], from_rotvec(self.leads_at(self._phase[rows])))
        self._tables["targets"] = np.concatenate([continuous(led), speeds], axis=-1)


class LiveReference(Reference):
    """Frames come in by `append`, one before every control step; a phase is seconds since the first frame.

    newest: number of the newest frame that has come; `present` is KNOWN frames before it, in seconds.
    """

    def __init__(self, root: Array, rotations: Array, predict: Predict) -> None:
        """The reference has stood in a pose of root (3,) and rotations (20, 4) until now."""
        self.newest = KNOWN
        self._predict = predict
        self._captured = deque([(root, rotations)] * MEMORY, maxlen=MEMORY)
        self._followed = deque([(root, rotations)] * (BEHIND + KNOWN + 1), maxlen=BEHIND + KNOWN + 1)
        self._stretch = self._stretched(0.0, 1.0)

    @property
    def present(self) -> float:
        """Phase at which the coming control step begins."""
        return (self.newest - KNOWN) / RATE

    def append(self, root: Array, rotations: Array, noise: float = 0.0, on_the_spot: float = 0.0) -> None:
        """The next frame, of root (3,) and local rotations (20, 4), how noisy it is, 0 to 1, and whether the
        person stays on the spot, 0 to 1."""
        self.newest += 1
        self._captured.append((root, rotations))
        self._stretch = self._stretched(noise, on_the_spot)

    def _stretched(self, noise: float, on_the_spot: float) -> Reference:
        roots, turns = (np.array(column) for column in zip(*self._captured, strict=True))
        root, rotations = self._predict(roots, turns, noise, on_the_spot)
        # Where noise has moved the path, it stays: from there on, its steps count.
        root = root + np.append(self._followed[-1][0][:2] - roots[-2, :2], 0.0)
        self._followed.append((root[0], rotations[0]))
        followed, turned = (np.array(column) for column in zip(*self._followed, strict=True))
        return _Stretch(
            Motion(
                RATE,
                np.concatenate([followed, root[1:]]),
                continuous(np.concatenate([turned, rotations[1:]])),
                np.zeros((BEHIND + 1 + AHEAD, 2), dtype=np.bool_),
                cyclic=False,
            )
        )

    @property
    def duration(self) -> float:
        """A second, so that phases are seconds."""
        return 1.0

    @property
    def cyclic(self) -> bool:
        """Nothing repeats."""
        return False

    @property
    def cycle_offset(self) -> Array:
        """Nothing repeats."""
        return np.zeros(3)

    def _within(self, phase: Array) -> Array:
        """Phases of the stretch; those before it are its first frame, those after it its last."""
        first = self.newest - KNOWN - BEHIND
        place = (np.asarray(phase) * RATE - first) / (BEHIND + AHEAD)
        # Rounding must not put the last frame beyond the end.
        return np.clip(place, 0.0, 1.0)

    def bodies(self, phase: Array) -> BodyStates:
        return self._stretch.bodies(self._within(phase))

    def poses(self, phase: Array) -> Poses:
        return self._stretch.poses(self._within(phase))

    def root(self, phase: Array) -> Array:
        return self._stretch.root(self._within(phase))

    def nodes(self, phase: Array) -> Array:
        return self._stretch.nodes(self._within(phase))

    def joints(self, phase: Array) -> tuple[Array, Array]:
        return self._stretch.joints(self._within(phase))

    def targets(self, phase: Array) -> tuple[Array, Array]:
        return self._stretch.targets(self._within(phase))

    def tables(self) -> dict[str, Array]:
        return self._stretch.tables()
