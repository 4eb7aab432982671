"""Obstacles, and arrows for the forces on the simulated humanoid."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr

from kinemimic.evaluate.film import arrow_scales
from kinemimic.evaluate.film.figures import SIMULATED, Humanoid
from kinemimic.evaluate.film.solids import Capsule, Color, Solid, obstacle_solid
from kinemimic.evaluate.view.scene import SCENES, entity_path, frame_times, time_columns
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.retarget.humanoid.body import BODY_CENTERS, BODY_NODES
from kinemimic.train.sim.world import Obstacle

OBSTACLE_COLOR = (150, 110, 80)
LOAD_COLOR, CONTACT_COLOR = (255, 60, 60), (90, 220, 120)


@dataclass(frozen=True)
class Disturbances:
    """A scenario's obstacles and forces over F frames.

    obstacles: K of them; states: (F, K, 13) as in `World.obstacles`, NaN before an obstacle appears; loads:
    (F, 15, 3) force on each body in N.
    """

    obstacles: Sequence[Obstacle]
    states: Array
    loads: Array


def log_contacts(stream: rr.RecordingStream, simulated: Humanoid, forces: Array) -> None:
    """Log contact forces (F, 15, 3) in N as arrows on the simulated bodies, in both scenes."""
    _log_arrows(stream, "contacts", simulated, forces / arrow_scales.CONTACT, CONTACT_COLOR)


def log_disturbances(stream: rr.RecordingStream, simulated: Humanoid, disturbances: Disturbances) -> None:
    """Log the obstacles, from when they appear, and the scenario's forces, in both scenes."""
    _log_arrows(stream, "loads", simulated, disturbances.loads / arrow_scales.FORCE, LOAD_COLOR)
    seconds = frame_times(len(disturbances.states))
    for k, item in enumerate(disturbances.obstacles):
        there = np.flatnonzero(np.isfinite(disturbances.states[:, k, 0]))
        if not len(there):
            continue
        first = int(there[0])
        poses = rr.Transform3D.columns(
            translation=disturbances.states[first:, k, :3].astype(np.float32),
            quaternion=disturbances.states[first:, k, 3:7].astype(np.float32),
        )
        for scene in SCENES:
            place = f"{entity_path(scene, SIMULATED)}/obstacles/{k + 1}"
            # Without a shape before it appears, the obstacle is invisible.
            stream.send_columns(place, time_columns(seconds[first : first + 1]), _look(item))
            stream.send_columns(place, time_columns(seconds[first:]), poses)


def disturbance_solids(simulated: Humanoid, disturbances: Disturbances) -> Callable[[int], list[Solid]]:
    """Obstacles and forces of a frame as solids to draw; a force is a rod from the body, with a knob."""

    def solids(frame: int) -> list[Solid]:
        states = disturbances.states[frame]
        shown: list[Solid] = [
            obstacle_solid(item, state, _share(OBSTACLE_COLOR))
            for item, state in zip(disturbances.obstacles, states, strict=True)
            if np.isfinite(state[0])
        ]
        for body in np.flatnonzero(disturbances.loads[frame].any(axis=-1)).tolist():
            node = BODY_NODES[body]
            start = simulated.positions[frame, node] + rotate(
                simulated.rotations[frame, node], BODY_CENTERS[body]
            )
            end = start + disturbances.loads[frame, body] / arrow_scales.FORCE
            color = _share(LOAD_COLOR)
            shown += [Capsule(start, end, 0.012, color), Capsule(end, end, 0.03, color)]
        return shown

    return solids


def _share(color: tuple[int, int, int]) -> Color:
    return color[0] / 255, color[1] / 255, color[2] / 255


def _look(item: Obstacle) -> Iterable[Any]:
    """The shape of an obstacle, as columns for a single time."""
    half = [[0.5 * side for side in item.size]]
    color, solid = [OBSTACLE_COLOR], [rr.components.FillMode.Solid]
    if item.shape == "box":
        return rr.Boxes3D.columns(half_sizes=half, colors=color, fill_mode=solid)
    if item.shape == "sphere":
        return rr.Ellipsoids3D.columns(half_sizes=half, colors=color, fill_mode=solid)
    radius = [0.5 * item.size[0]]
    return rr.Cylinders3D.columns(lengths=[item.size[2]], radii=radius, colors=color, fill_mode=solid)


def _log_arrows(
    stream: rr.RecordingStream, name: str, humanoid: Humanoid, vectors: Array, color: tuple[int, int, int]
) -> None:
    """Log arrows (F, 15, 3) in metres from the centres of the bodies; none for zero vectors."""
    push = vectors.any(axis=-1)
    frame, body = np.nonzero(push)
    node = np.array(BODY_NODES)[body]
    origins = humanoid.positions[frame, node] + rotate(humanoid.rotations[frame, node], BODY_CENTERS[body])
    columns = rr.Arrows3D.columns(
        origins=origins.astype(np.float32), vectors=vectors[push].astype(np.float32)
    )
    for scene in SCENES:
        place = f"{entity_path(scene, SIMULATED)}/{name}"
        stream.log(place, rr.Arrows3D.from_fields(colors=[color], radii=[0.012]), static=True)
        stream.send_columns(
            place, time_columns(frame_times(len(vectors))), columns.partition(push.sum(axis=1))
        )
