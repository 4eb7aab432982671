"""DeepMimic motions: JSON with 44 numbers a frame, on the figure that Bullet ships with them.

The file's world is Y up with X forward and Z to the right; quaternions are w first; a knee's one angle is
negative in flexion and an elbow's positive. The pybullet wheel carries such files, among them a walk and a
run that are optical captures of a real person.
"""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.clip import Clip, forward_kinematics
from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.rotations import IDENTITY, continuous, from_axis_angle, normalize
from kinemimic.pipeline.skeleton import NODE_INDEX, NODES, TRACKED, node_skeleton
from kinemimic.pipeline.store import file_hash

Array = NDArray[np.float64]

FORMAT = "DeepMimic JSON"
_COLUMNS = 44
_ROOT = slice(1, 4)
# First column of each ball joint's quaternion, and column and sign of each hinge's flexion.
_BALLS: dict[str, int] = {
    "hip_center": 4,
    "spine": 8,
    "shoulder_center": 12,
    "hip_right": 16,
    "ankle_right": 21,
    "shoulder_right": 25,
    "hip_left": 30,
    "ankle_left": 35,
    "shoulder_left": 39,
}
# A hinge turns about the file's Z (right), which is our -Y: the angle changes its sign with the axis.
_HINGES: dict[str, int] = {"knee_right": 20, "elbow_right": 29, "knee_left": 34, "elbow_left": 43}


def offsets() -> Array:
    """Joint positions (20, 3) in their parents' frames, metres: pybullet_data/humanoid/humanoid.urdf over 4.

    That file is four times human size. Its neck carries the head's centre, its wrist a hand of 8 cm, and the
    foot node is the middle of the toe end of the foot box.
    """
    joints: dict[str, tuple[float, float, float]] = {
        "hip_center": (0.0, 0.0, 0.0),
        "spine": (0.0, 0.0, 0.236151),
        "shoulder_center": (0.0, 0.0, 0.223894),
        "head": (0.0, 0.0, 0.175),
    }
    for side, sign in (("left", 1.0), ("right", -1.0)):
        joints |= {
            f"shoulder_{side}": (-0.02405, sign * 0.18311, 0.2435),
            f"elbow_{side}": (0.0, 0.0, -0.274788),
            f"wrist_{side}": (0.0, 0.0, -0.258947),
            f"hand_{side}": (0.0, 0.0, -0.08),
            f"hip_{side}": (0.0, sign * 0.084887, 0.0),
            f"knee_{side}": (0.0, 0.0, -0.421546),
            f"ankle_{side}": (0.0, 0.0, -0.40987),
            f"foot_{side}": (0.1335, 0.0, -0.0225),
        }
    return np.array([joints[node] for node in NODES])


def stock_motion(name: str) -> Path:
    """Path of the wheel's motion of that name ("walk", "run"); pybullet itself is not loaded."""
    spec = importlib.util.find_spec("pybullet_data")
    if spec is None or spec.origin is None:
        raise KinemimicError(
            "expected the motions of the pybullet wheel, found no pybullet; install pybullet"
        )
    folder = Path(spec.origin).parent / "data" / "motions"
    path = folder / f"humanoid3d_{name}.txt"
    if not path.is_file():
        known = sorted(file.stem.removeprefix("humanoid3d_") for file in folder.glob("humanoid3d_*.txt"))
        raise KinemimicError(f"expected a stock motion ({', '.join(known)}), found {name!r}")
    return path


def read_deepmimic(path: Path) -> Clip:
    """The motion as a clip of the 20 nodes with rotations, every node tracked.

    Each frame's first number is the time to the next one; the last frame of a looped motion repeats the
    first, a cycle later.
    """
    frames = _frames(path)
    steps = frames[:-1, 0]
    if np.any(steps <= 0):
        row = int(np.argmax(steps <= 0))
        raise CaptureError(
            path, expected="a positive time step", found=f"{steps[row]:g}", where=f"frame {row}"
        )
    rotations = np.broadcast_to(IDENTITY, (len(frames), len(NODES), 4)).copy()
    for node, column in _BALLS.items():
        w, x, y, z = frames[:, column : column + 4].T
        rotations[:, NODE_INDEX[node]] = np.stack([x, -z, y, w], axis=-1)
    lengths = np.linalg.norm(rotations, axis=-1)
    if np.any(np.abs(lengths - 1.0) > 0.01):
        frame, node_number = (int(k) for k in np.argwhere(np.abs(lengths - 1.0) > 0.01)[0])
        raise CaptureError(
            path,
            expected=f"a unit quaternion at {NODES[node_number]}",
            found=f"length {lengths[frame, node_number]:.3f}",
            where=f"frame {frame}",
        )
    for node, column in _HINGES.items():
        rotations[:, NODE_INDEX[node]] = from_axis_angle("Y", -frames[:, column])
    rotations = continuous(normalize(rotations))
    skeleton = node_skeleton(offsets())
    translations = np.broadcast_to(skeleton.offsets, (len(frames), len(NODES), 3)).copy()
    x, y, z = frames[:, _ROOT].T
    translations[:, 0] = np.stack([x, -z, y], axis=-1)
    return Clip(
        skeleton=skeleton,
        times=np.concatenate([[0.0], np.cumsum(steps)]),
        positions=forward_kinematics(skeleton, translations, rotations)[0],
        states=np.full((len(frames), len(NODES)), TRACKED, dtype=np.uint8),
        passes=np.zeros(len(frames), dtype=np.int32),
        translations=translations,
        rotations=rotations,
        provenance={"source": path.name, "format": FORMAT, "sha256": file_hash(path)},
    )


def _frames(path: Path) -> Array:
    """The numbers of the file, (T, 44), checked."""
    try:
        content: Any = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise CaptureError(path, expected="a DeepMimic motion", found="no file") from None
    except (ValueError, UnicodeDecodeError) as error:
        raise CaptureError(path, expected="a DeepMimic motion (JSON)", found=str(error)) from None
    rows = content.get("Frames") if isinstance(content, dict) else None
    if not isinstance(rows, list) or len(rows) < 2:
        raise CaptureError(path, expected='"Frames" with two frames or more', found="none")
    for number, row in enumerate(rows):
        if not isinstance(row, list) or len(row) != _COLUMNS:
            count = len(row) if isinstance(row, list) else type(row).__name__
            raise CaptureError(
                path, expected=f"{_COLUMNS} numbers", found=f"{count}", where=f"frame {number}"
            )
    try:
        frames = np.array(rows, dtype=np.float64)
    except (TypeError, ValueError):
        raise CaptureError(path, expected="numbers only", found="something else in a frame") from None
    if not np.isfinite(frames).all():
        bad = int(np.argwhere(~np.isfinite(frames))[0][0])
        raise CaptureError(path, expected="finite numbers", found="NaN or infinity", where=f"frame {bad}")
    return frames
