"""The figures of a rollout as motions of their nodes, and their names and colours in every picture."""

from __future__ import annotations

from dataclasses import dataclass

from kinemimic.pipeline.arrays import Array
from kinemimic.retarget.humanoid.motion import node_kinematics
from kinemimic.train.rollout.trajectory import Trajectory

REFERENCE, SIMULATED, CAPTURED = 1, 2, 3  # class ids
COLORS = {REFERENCE: (120, 190, 255), SIMULATED: (255, 150, 50), CAPTURED: (170, 170, 170)}
NAMES = {REFERENCE: "reference", SIMULATED: "simulated", CAPTURED: "captured"}


@dataclass(frozen=True)
class Humanoid:
    """A humanoid's motion: positions (F, 20, 3) and rotations (F, 20, 4) of its nodes in the world."""

    kind: int
    positions: Array
    rotations: Array


def humanoids(trajectory: Trajectory, rollout: int, offsets: Array) -> tuple[Humanoid, Humanoid]:
    """Reference and simulated humanoid of a rollout; offsets: (20, 3) of the nodes from their parents."""

    def humanoid(kind: int, root: Array, rotations: Array) -> Humanoid:
        return Humanoid(kind, *node_kinematics(root, rotations, offsets))

    return (
        humanoid(REFERENCE, trajectory.reference_root[rollout], trajectory.reference_rotations[rollout]),
        humanoid(SIMULATED, trajectory.root[rollout], trajectory.rotations[rollout]),
    )
