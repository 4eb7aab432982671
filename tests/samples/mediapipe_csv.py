"""MediaPipe's world landmarks of the known walk: a row a frame, as a phone's video shows them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES
from kinemimic.pipeline.readers.landmarks.blaze_pose import LANDMARKS, NUMBER
from samples.azure_kinect import camera_axes
from samples.motion import Walk, walk


def world_landmarks(shown: Walk) -> Array:
    """(T, 33, 3) metres about the middle of the hips, X right, Y down, Z forward, seen from behind.

    Ears and knuckles are to both sides of head and hand; what no node needs is at the head's centre, a heel
    at its ankle.
    """
    p = {name: shown.joints[:, NODE_INDEX[name]] for name in NODES}
    points = np.repeat(p["head"][:, None], len(LANDMARKS), axis=1)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        points[:, NUMBER[f"{side}_ear"]] = p["head"] + np.array([0.0, 0.08 * sign, 0.0])
        for joint in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle"):
            points[:, NUMBER[f"{side}_{joint}"]] = p[f"{joint}_{side}"]
        points[:, NUMBER[f"{side}_heel"]] = p[f"ankle_{side}"]
        points[:, NUMBER[f"{side}_foot_index"]] = p[f"foot_{side}"]
        for knuckle, out in (("index", 0.03), ("pinky", -0.03), ("thumb", 0.05)):
            points[:, NUMBER[f"{side}_{knuckle}"]] = p[f"hand_{side}"] + np.array([out, 0.0, 0.0])
    middle = 0.5 * (p["hip_left"] + p["hip_right"])
    return camera_axes(points - middle[:, None])


def visibility(frames: int) -> Array:
    """(T, 33): the left wrist is hidden in the last third."""
    seen = np.full((frames, len(LANDMARKS)), 0.98)
    seen[2 * frames // 3 :, NUMBER["left_wrist"]] = 0.2
    return seen


def about_hips(shown: Walk, nodes: Sequence[str]) -> Array:
    """(T, n, 3) where the nodes of the walk are, from the middle of its hips."""
    hips = 0.5 * (shown.joints[:, NODE_INDEX["hip_left"]] + shown.joints[:, NODE_INDEX["hip_right"]])
    return shown.joints[:, [NODE_INDEX[name] for name in nodes]] - hips[:, None]


def table(points: Array, beside: Mapping[str, Sequence[object]], spelling: str = "{name}_{axis}") -> str:
    """A row for each of (R, 33, 3), behind other columns; spelling: of {name} or {number}, and {axis}."""
    names = [
        spelling.format(number=number, name=name, axis=axis)
        for number, name in enumerate(LANDMARKS)
        for axis in "xyz"
    ]
    rows = [
        ",".join(
            [*(str(values[k]) for values in beside.values()), *(f"{value:.9g}" for value in row.ravel())]
        )
        for k, row in enumerate(points)
    ]
    return "\n".join([",".join([*beside, *names]), *rows]) + "\n"


def files(frames: int = 90) -> dict[str, bytes]:
    """One row a frame; nobody is seen in the third."""
    shown = walk(frames)
    values = np.concatenate([world_landmarks(shown), visibility(frames)[..., None]], axis=-1)
    fields = ("x", "y", "z", "visibility")
    names = [f"landmark_{number}_{field}" for number in range(len(LANDMARKS)) for field in fields]
    lines = [",".join(["frame_number", "timestamp", *names])]
    for frame, (time, row) in enumerate(zip(shown.times, values, strict=True)):
        cells = ["" if frame == 2 else f"{value:.9g}" for value in row.ravel()]
        lines.append(",".join([str(frame), f"{1000.0 * time:.9g}", *cells]))
    return {"pose_landmarks.csv": ("\n".join(lines) + "\n").encode()}
