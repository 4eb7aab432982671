"""NTU RGB+D's layout: counts, bodies, joints; an empty frame first, and a still thing beside the person."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from samples.khokhlova import orientations
from samples.kimore import SENSOR
from samples.motion import in_sight, kinect_v2_joints, walk, y_up

PERSON, CHAIR = 72057594037931101, 72057594037931102
EMPTY_FRAMES = 2


def body(number: int, places: Array, turns: Array, state: int = 2) -> list[str]:
    """The lines of one body of one frame; places: (25, 3); turns: (25, 4), x, y, z, w."""
    lines = [f"{number} 0 1 1 1 1 0 0.02764709 0.05745083 2", "25"]
    for place, turn in zip(places, turns, strict=True):
        numbers = [*place, 277.419, 191.824, 1036.233, 519.1677, turn[3], *turn[:3]]
        lines.append(" ".join(f"{value:.7g}" for value in numbers) + f" {state}")
    return lines


def files(frames: int = 90) -> dict[str, bytes]:
    """The person in every frame but the first two; a chair in all but the first four, its joints inferred."""
    places = y_up(kinect_v2_joints(in_sight(walk(frames)))) + SENSOR
    turns = orientations(places)
    lines = [f"{frames + EMPTY_FRAMES}", *["0"] * EMPTY_FRAMES]
    chair = 0.3 * (places[0] - places[0, 0]) + places[0, 0] + np.array([0.8, -0.3, 0.0])
    for number in range(frames):
        bodies = [body(PERSON, places[number], turns[number])]
        if number >= EMPTY_FRAMES:
            bodies.insert(0, body(CHAIR, chair, turns[0], state=1))
        lines += [f"{len(bodies)}", *(line for one in bodies for line in one)]
    return {"S001C001P001R001A059.skeleton": "\r\n".join([*lines, ""]).encode()}
