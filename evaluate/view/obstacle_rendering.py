"""What is about the simulated figure: obstacles, and arrows of what pushes it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr

from kinemimic.evaluate.view.scene import SCENES, SIMULATED, Figure, clock, moments, place_of
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.retarget.humanoid.body import BODIES, BODY_NODES
from kinemimic.train.sim.world import Obstacle

OBSTACLE_COLOR = (150, 110, 80)
LOAD_COLOR, CONTACT_COLOR = (255, 60, 60), (90, 220, 120)
LOAD_SCALE, CONTACT_SCALE = 100.0, 1000.0  # N to a metre of arrow


@dataclass(frozen=True)
class Props:
    """What a scenario put about the simulated figure in F frames.

    obstacles: K of them; states: (F, K, 13) as in `World.obstacles`, NaN before one appears;
    loads: (F, 15, 3) force on each body, N.
    """

    obstacles: Sequence[Obstacle]
    states: Array
    loads: Array


def log_contacts(stream: rr.RecordingStream, simulated: Figure, forces: Array) -> None:
    """Arrows of the contact forces (F, 15, 3) in N on the simulated figure's bodies, in both scenes."""
    _log_arrows(stream, "contacts", simulated, forces / CONTACT_SCALE, CONTACT_COLOR)


def log_props(stream: rr.RecordingStream, simulated: Figure, props: Props) -> None:
    """In both scenes the obstacles, from when they appear, and the scenario's forces."""
    _log_arrows(stream, "loads", simulated, props.loads / LOAD_SCALE, LOAD_COLOR)
    seconds = clock(len(props.states))
    for k, item in enumerate(props.obstacles):
        there = np.flatnonzero(np.isfinite(props.states[:, k, 0]))
        if not len(there):
            continue
        first = int(there[0])
        poses = rr.Transform3D.columns(
            translation=props.states[first:, k, :3].astype(np.float32),
            quaternion=props.states[first:, k, 3:7].astype(np.float32),
        )
        for scene in SCENES:
            place = f"{place_of(scene, SIMULATED)}/obstacles/{k + 1}"
            # It has no shape before it appears, and so is not seen.
            stream.send_columns(place, moments(seconds[first : first + 1]), _look(item))
            stream.send_columns(place, moments(seconds[first:]), poses)


def _look(item: Obstacle) -> Iterable[Any]:
    """Columns of one moment: the shape of an obstacle."""
    half = [[0.5 * side for side in item.size]]
    color, solid = [OBSTACLE_COLOR], [rr.components.FillMode.Solid]
    if item.shape == "box":
        return rr.Boxes3D.columns(half_sizes=half, colors=color, fill_mode=solid)
    if item.shape == "sphere":
        return rr.Ellipsoids3D.columns(half_sizes=half, colors=color, fill_mode=solid)
    radius = [0.5 * item.size[0]]
    return rr.Cylinders3D.columns(lengths=[item.size[2]], radii=radius, colors=color, fill_mode=solid)


def _log_arrows(
    stream: rr.RecordingStream, name: str, figure: Figure, vectors: Array, color: tuple[int, int, int]
) -> None:
    """Arrows (F, 15, 3) in metres from the middles of the bodies; none where nothing pushes."""
    push = vectors.any(axis=-1)
    frame, body = np.nonzero(push)
    node = np.array(BODY_NODES)[body]
    centers = np.array([one.center for one in BODIES])[body]
    origins = figure.positions[frame, node] + rotate(figure.rotations[frame, node], centers)
    columns = rr.Arrows3D.columns(
        origins=origins.astype(np.float32), vectors=vectors[push].astype(np.float32)
    )
    for scene in SCENES:
        place = f"{place_of(scene, SIMULATED)}/{name}"
        stream.log(place, rr.Arrows3D.from_fields(colors=[color], radii=[0.012]), static=True)
        stream.send_columns(place, moments(clock(len(vectors))), columns.partition(push.sum(axis=1)))
