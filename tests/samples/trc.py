"""OpenSim's marker file, with markers from which the known walk's joints follow exactly."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers.optical.joint_centres import BELL
from samples.motion import Walk, in_sight, walk

# Half of a knee and of an ankle with its marker, metres.
HALF = {"knee": 0.055, "ankle": 0.04}
RATE = 100.0


def unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def at(walk: Walk, node: str) -> Array:
    return walk.joints[:, NODE_INDEX[node]]


def pelvis_of(walk: Walk) -> tuple[Array, Array, float]:
    """Midpoint of the ASIS (T, 3), axes (T, 3, 3) forward, left, up, and their distance: Bell's, inverted."""
    left = unit(at(walk, "hip_left") - at(walk, "hip_right"))
    up = at(walk, "spine") - at(walk, "hip_center")
    up = unit(up - np.sum(up * left, axis=-1, keepdims=True) * left)
    axes = np.stack([np.cross(left, up), left, up], axis=-1)
    apart = np.linalg.norm(at(walk, "hip_left") - at(walk, "hip_right"), axis=-1)
    width = float(np.median(apart)) / (2.0 * BELL[1])
    middle = 0.5 * (at(walk, "hip_left") + at(walk, "hip_right"))
    return middle - axes @ (width * np.array([BELL[0], 0.0, BELL[2]])), axes, width


def markers(walk: Walk) -> dict[str, Array]:
    """Label -> places (T, 3), metres, our axes: pelvis, medial and lateral knees and ankles, trunk, arms."""
    origin, axes, width = pelvis_of(walk)
    forward, left = axes[..., 0], axes[..., 1]
    shoulders = [at(walk, f"shoulder_{side}") for side in ("left", "right")]
    hips = 0.5 * (at(walk, "hip_left") + at(walk, "hip_right"))
    spread = np.linalg.norm(shoulders[0] - shoulders[1], axis=-1, keepdims=True)
    drop = 0.17 * spread * unit(hips - 0.5 * (shoulders[0] + shoulders[1]))
    places = {"V.Sacral": origin - 0.14 * forward}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        s = side[0].upper()
        places[f"{s}.ASIS"] = origin + 0.5 * sign * width * left
        for joint, half in HALF.items():
            for label, out in (("Lat", sign), ("Med", -sign)):
                places[f"{s}.{joint.title()}.{label}"] = at(walk, f"{joint}_{side}") + out * half * left
        places[f"{s}.Toe.Tip"] = at(walk, f"foot_{side}")
        places[f"{s}.Acromium"] = at(walk, f"shoulder_{side}") - drop
        places[f"{s}.Elbow"] = at(walk, f"elbow_{side}")
        for label, out in (("Lat", 0.03), ("Med", -0.03)):
            places[f"{s}.Wrist.{label}"] = at(walk, f"wrist_{side}") + out * left
    places["Top.Head"] = at(walk, "head")
    return places


def text(labels: list[str], times: Array, points: Array, *, rate: float = RATE, declared: int = -1) -> str:
    """points: (T, M, 3) mm, X forward, Y up, Z right; NaN: empty cells; declared: the header's NumFrames."""
    count = len(times) if declared < 0 else declared
    head = [
        "PathFileType\t4\t(X/Y/Z)\twalk.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate:.2f}\t{rate:.2f}\t{count}\t{len(labels)}\tmm\t{rate:.2f}\t1\t{count}",
        "Frame#\tTime\t" + "\t".join(f"{label}\t\t" for label in labels),
        "\t\t" + "\t".join(f"X{k}\tY{k}\tZ{k}" for k in range(1, len(labels) + 1)),
        "",
    ]
    rows = [
        f"{k + 1}\t{time:.3f}\t" + "\t".join("" if np.isnan(x) else f"{x:.6f}" for x in frame.ravel())
        for k, (time, frame) in enumerate(zip(times, points, strict=True))
    ]
    return "\n".join([*head, *rows]) + "\n"


def files(frames: int = 90) -> dict[str, bytes]:
    """One file."""
    shown = in_sight(walk(frames, RATE))
    places = markers(shown)
    points = 1000.0 * np.stack(list(places.values()), axis=1)[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    return {"walk.trc": text(list(places), shown.times, points).encode()}
