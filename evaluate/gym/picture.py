"""The picture of an environment as it is now: the humanoid, and its reference as a ghost."""

from __future__ import annotations

import numpy as np

from kinemimic.evaluate.film.camera import camera_path
from kinemimic.evaluate.film.figures import REFERENCE, SIMULATED, Humanoid
from kinemimic.evaluate.film.looks import FIGURE, GHOST, LOOKS
from kinemimic.evaluate.film.render import Picture, draw_frame
from kinemimic.evaluate.film.solids import body_solids
from kinemimic.pipeline.arrays import Array
from kinemimic.retarget.humanoid.body import node_offsets
from kinemimic.retarget.humanoid.motion import node_kinematics
from kinemimic.train.rollout.rollout import node_rotations
from kinemimic.train.sim.world import CONTROL_RATE
from kinemimic.train.task.env import ImitationBatch

SIZE = (480, 480)
_AROUND = 60  # frames before and after now, over which the camera's path is smoothed


def picture(batch: ImitationBatch, index: int) -> Picture:
    """Environment `index` of a batch, (480, 480, 3); obstacles are not drawn.

    The camera follows the reference, whose future is known: a picture depends only on the present state.
    """
    steps = np.arange(-_AROUND, _AROUND + 1) / (CONTROL_RATE * batch.reference.duration)
    phases = batch.phases[index] + steps
    guide = _humanoid(REFERENCE, batch.reference.root(phases), batch.reference.nodes(phases))
    camera = camera_path("follow", guide, guide, CONTROL_RATE, SIZE, len(phases))[_AROUND]
    figure = _humanoid(
        SIMULATED, batch.bodies.positions[index, :1], node_rotations(batch.bodies)[index, None]
    )
    return draw_frame(
        camera,
        LOOKS["light"],
        list(body_solids(figure.positions[0], figure.rotations[0], FIGURE)),
        list(body_solids(guide.positions[_AROUND], guide.rotations[_AROUND], GHOST)),
        figure.positions[0, 0, :2],
    )


def _humanoid(kind: int, root: Array, rotations: Array) -> Humanoid:
    """A motion (F) of root (F, 3) and local rotations (F, 20, 4)."""
    return Humanoid(kind, *node_kinematics(root, rotations, node_offsets()))
