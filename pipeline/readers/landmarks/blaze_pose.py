"""The 33 landmarks of MediaPipe's pose model (BlazePose), and the nodes that they give.

Names and order: "Pose landmark detection guide", ai.google.dev/edge/mediapipe. A detection has two lists of
them. World landmarks are metres about the middle of the hips, X to the right of the picture, Y down, Z away
from the camera. Some programs put them where the person is, in metres from the camera. Image landmarks are
shares of the picture's width and height, their Z a share of its width about the hips that is not measured:
they have neither a scale nor a shape before the picture's size is known.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array, States
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, NODES, TRACKED
from kinemimic.pipeline.quality.rules.length_units import LEG_RANGE, USUAL_LEG
from kinemimic.pipeline.readers.base.clip_building import clip_of_points
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.node_parents import skeleton_of
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.azure_joints import WORLD_FROM_CAMERA

_PAIRS: tuple[str, ...] = ("shoulder", "elbow", "wrist", "pinky", "index", "thumb")
LANDMARKS: tuple[str, ...] = (
    "nose",
    *(f"{side}_eye{part}" for side in ("left", "right") for part in ("_inner", "", "_outer")),
    *(f"{side}_ear" for side in ("left", "right")),
    *(f"mouth_{side}" for side in ("left", "right")),
    *(
        f"{side}_{joint}"
        for joint in (*_PAIRS, "hip", "knee", "ankle", "heel", "foot_index")
        for side in ("left", "right")
    ),
)
NUMBER: dict[str, int] = {name: number for number, name in enumerate(LANDMARKS)}
# Node -> the landmarks whose middle it is: between the ears is a head's centre, between the knuckles a palm.
OF_NODE: dict[str, tuple[str, ...]] = {
    "head": ("left_ear", "right_ear"),
    **{
        f"{joint}_{side}": (f"{side}_{joint}",)
        for joint in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
        for side in ("left", "right")
    },
    **{f"hand_{side}": (f"{side}_index", f"{side}_pinky") for side in ("left", "right")},
    **{f"foot_{side}": (f"{side}_foot_index",) for side in ("left", "right")},
}
# The landmarks without which there are no legs.
LEGS: tuple[str, ...] = tuple(
    f"{side}_{joint}" for joint in ("hip", "knee", "ankle") for side in ("left", "right")
)
# Landmarks below this visibility or presence are guessed: behind the body, or outside the picture.
_SEEN = 0.5
# Metres by which the middle of the hips of world landmarks may deviate from their origin, which it is.
_ORIGIN = 0.05
# Image landmarks lie in the picture, or not far outside it, in shares of its size.
_PICTURE = (-1.0, 2.0)
FIT_FOR_USE = "save pose_world_landmarks, or give the video itself to `kinemimic ingest`"


def path_of_landmarks(points: Array, source: Source, *, told: bool = False) -> str:
    """A note that says whether the landmarks (T, 33, 3) move with the person, or about the hips alone.

    Raises CaptureError for image landmarks. They are told apart by the size of the body, which is in metres
    unless the user named another unit; where a close person's legs measure as much in shares of a picture as
    a child's in metres, by the depth of the hips, which image landmarks do not have. told: the unit is the
    one that makes the legs a person's, so that their size says nothing.
    """
    hips = points[:, [NUMBER["left_hip"], NUMBER["right_hip"]]].mean(axis=1)
    seen = hips[np.isfinite(hips).all(axis=-1)]
    if not len(seen):
        raise source.error(expected="frames with both hips", found="none")
    with np.errstate(over="ignore"):  # a damaged file may hold any number
        off = np.median(np.linalg.norm(seen, axis=-1))
    if off <= _ORIGIN:
        return "the hips stay where they are: the path is not in the file"
    flat = points[..., :2][np.isfinite(points[..., :2])]
    low, high = np.percentile(flat, [2.5, 97.5])
    x, y, _ = np.median(seen, axis=0)
    depth = np.median(np.abs(seen[:, 2]))
    leg = leg_length(points)
    in_picture = _PICTURE[0] <= low and high <= _PICTURE[1]
    if told and depth <= _ORIGIN:
        found = "hips that move, but have no depth: image landmarks in pixels?"
    elif in_picture and depth <= _ORIGIN and leg < USUAL_LEG[0]:
        found = f"image landmarks, shares of a picture (the middle of the hips at {x:.2f}, {y:.2f})"
    elif source.unit is None and not LEG_RANGE[0] <= leg <= LEG_RANGE[1]:
        found = f"a leg of {leg:.4g}, the middle of the hips at {x:.4g}, {y:.4g}: image landmarks in pixels?"
    else:
        return "the hips move: the path is in the file"
    raise source.error(expected="world landmarks, in metres", found=found, advice=FIT_FOR_USE)


def leg_length(points: Array) -> float:
    """Median length of thigh plus shank of both sides in (T, 33, 3); NaN if no frame has a whole leg."""
    lengths = []
    for side in ("left", "right"):
        hip, knee, ankle = (points[:, NUMBER[f"{side}_{joint}"]] for joint in ("hip", "knee", "ankle"))
        with np.errstate(over="ignore", invalid="ignore"):  # a damaged file may hold any number
            lengths.append(np.linalg.norm(hip - knee, axis=-1) + np.linalg.norm(knee - ankle, axis=-1))
    known = np.concatenate(lengths)
    known = known[np.isfinite(known)]
    return float(np.median(known)) if len(known) else np.nan


def clip_of_landmarks(
    points: Array,
    visibility: Array | None,
    times: Array,
    *,
    format: Format,
    reading: Mapping[str, Any],
    world_from_file: Array = WORLD_FROM_CAMERA,
) -> Clip:
    """The clip of the nodes that the landmarks give.

    points: (T, 33, 3) metres in the file's axes, NaN for a landmark that the file does not have; visibility:
    (T, 33) 0 to 1, NaN where unknown; times: (T,) seconds. A node is inferred where one of its landmarks is
    less visible than one half. format, reading, world_from_file: as in `clip_of_points`.
    """
    nodes, places, states = [], [], []
    for node in NODES:
        numbers = [NUMBER[name] for name in OF_NODE.get(node, ())]
        if not numbers or not np.isfinite(points[:, numbers]).all(axis=(1, 2)).any():
            continue
        nodes.append(node)
        places.append(points[:, numbers].mean(axis=1))
        states.append(states_of(points[:, numbers], None if visibility is None else visibility[:, numbers]))
    return clip_of_points(
        skeleton_of(tuple(nodes)),
        times,
        np.stack(places, axis=1),
        np.stack(states, axis=1),
        format=format,
        reading=reading,
        world_from_file=world_from_file,
    )


def states_of(points: Array, visibility: Array | None) -> States:
    """States (T,) of a node from its landmarks (T, n, 3) and their visibility (T, n)."""
    states = np.full(len(points), TRACKED, dtype=np.uint8)
    if visibility is not None:
        states[(visibility < _SEEN).any(axis=1)] = INFERRED
    states[~np.isfinite(points).all(axis=(1, 2))] = MISSING
    return states
