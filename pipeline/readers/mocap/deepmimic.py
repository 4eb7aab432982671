"""DeepMimic motions: JSON with 44 numbers per frame, for the humanoid that ships with Bullet.

The file's world is Y up with X forward and Z to the right; quaternions are w first; a knee's angle is
negative in flexion and an elbow's positive. The pybullet wheel contains such files, among them a walk and a
run that are optical captures of a real person.
"""

from __future__ import annotations

import importlib.util
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.rotations import IDENTITY, continuous, from_axis_angle, normalize
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX, NODES, TRACKED, node_skeleton
from kinemimic.pipeline.readers.base.clip_building import reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.json_text import numbers, parse_json
from kinemimic.pipeline.readers.base.source import Source

FORMAT = Format(
    name="DeepMimic JSON",
    sensor="optical, retargeted",
    holds="quaternions and hinge angles of a humanoid",
    recognised_by='a JSON object with the key "Frames"',
)
COLUMNS = 44
# Frames of other programs.
_OBJECTS = re.compile(r'"Frames"\s*:\s*\[\s*\{')
# In metres, seconds and radians; larger numbers are damage.
_MAX_NUMBER = 1e4
# DeepMimic's own motions were blended linearly, which shortens a quaternion (to 0.58 in the kick) but keeps
# its direction. A length further from one than MAX_LENGTH_ERROR is damage, within EXACT_LENGTH it is exact.
MAX_LENGTH_ERROR = 0.5
EXACT_LENGTH = 0.01
ROOT = slice(1, 4)
# First column of each ball joint's quaternion.
BALLS: dict[str, int] = {
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
# Column of each hinge's flexion. A hinge rotates about the file's Z (right), our -Y, so the angle changes
# sign.
HINGES: dict[str, int] = {"knee_right": 20, "elbow_right": 29, "knee_left": 34, "elbow_left": 43}


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
    """Path of a motion in the pybullet wheel ("walk", "run"); pybullet itself is not imported."""
    spec = importlib.util.find_spec("pybullet_data")
    if spec is None or spec.origin is None:
        raise KinemimicError(
            "expected the motions of the pybullet wheel, found no pybullet; install it (Python 3.11), or "
            "name a capture: `kinemimic datasets fetch 'deepmimic_*'` fetches the same walk and run"
        )
    folder = Path(spec.origin).parent / "data" / "motions"
    path = folder / f"humanoid3d_{name}.txt"
    if not path.is_file():
        known = sorted(file.stem.removeprefix("humanoid3d_") for file in folder.glob("humanoid3d_*.txt"))
        raise KinemimicError(f"expected a stock motion ({', '.join(known)}), found {name!r}")
    return path


def recognises(source: Source) -> bool:
    """True for a JSON object with the key "Frames", unless these are objects."""
    head = "\n".join(source.head)
    return head.lstrip().startswith("{") and '"Frames"' in head and _OBJECTS.search(head) is None


def read_deepmimic(path: Path) -> Clip:
    """`read` for a path."""
    source = Source.open(path)
    clip = read(source)
    return replace(clip, provenance={"source": path.name, "sha256": source.sha256, **clip.provenance})


def read(source: Source) -> Clip:
    """The motion as a clip of the 20 nodes with rotations, every node tracked.

    Each frame's first number is the time to the next one; the last frame of a looped motion repeats the
    first, one cycle later. angles: the file's own knees.
    """
    frames = _frames(source)
    steps = frames[:-1, 0]
    if np.any(steps <= 0):
        row = int(np.argmax(steps <= 0))
        raise source.error(expected="a positive time step", found=f"{steps[row]:g}", where=f"frame {row}")
    rotations = np.broadcast_to(IDENTITY, (len(frames), len(NODES), 4)).copy()
    for node, column in BALLS.items():
        w, x, y, z = frames[:, column : column + 4].T
        rotations[:, NODE_INDEX[node]] = np.stack([x, -z, y, w], axis=-1)
    lengths = np.linalg.norm(rotations, axis=-1)
    if np.any(np.abs(lengths - 1.0) > MAX_LENGTH_ERROR):
        frame, node_number = (int(k) for k in np.argwhere(np.abs(lengths - 1.0) > MAX_LENGTH_ERROR)[0])
        raise source.error(
            expected=f"a unit quaternion at {NODES[node_number]}",
            found=f"length {lengths[frame, node_number]:.3f}",
            where=f"frame {frame}",
        )
    notes = ["the file holds no lengths: those of its humanoid are used"]
    inexact = np.abs(lengths - 1.0) > EXACT_LENGTH
    if inexact.any():
        low, high = lengths[inexact].min(), lengths[inexact].max()
        notes.append(f"{int(inexact.sum())} quaternions of length {low:.2f} to {high:.2f} normalised")
    for node, column in HINGES.items():
        rotations[:, NODE_INDEX[node]] = from_axis_angle("Y", -frames[:, column])
    rotations = continuous(normalize(rotations))
    skeleton = node_skeleton(offsets())
    translations = np.broadcast_to(skeleton.offsets, (len(frames), len(NODES), 3)).copy()
    x, y, z = frames[:, ROOT].T
    translations[:, 0] = np.stack([x, -z, y], axis=-1)
    return Clip(
        skeleton=skeleton,
        times=np.concatenate([[0.0], np.cumsum(steps)]),
        positions=forward_kinematics(skeleton, translations, rotations)[0],
        states=np.full((len(frames), len(NODES)), TRACKED, dtype=np.uint8),
        passes=np.zeros(len(frames), dtype=np.int32),
        translations=translations,
        rotations=rotations,
        angles={knee: -frames[:, HINGES[knee]] for knee in ("knee_left", "knee_right")},
        provenance={
            "format": FORMAT.name,
            "sensor": FORMAT.sensor,
            "reading": reading(units="m", units_rule="the format's", notes=notes, columns=COLUMNS),
        },
    )


def _frames(source: Source) -> Array:
    """The numbers of the file (T, 44), checked."""
    frames = _parse_regular(source)
    if frames is None:
        frames = _parse_as_json(source)
    if len(frames) < 2:
        raise source.error(expected='"Frames" with two frames or more', found="one")
    wrong = ~(np.abs(frames) < _MAX_NUMBER)  # NaN too
    if wrong.any():
        frame, column = (int(k) for k in np.argwhere(wrong)[0])
        raise source.error(
            expected=f"finite numbers below {_MAX_NUMBER:g}",
            found=f"{frames[frame, column]:g}",
            where=f"frame {frame}",
        )
    return frames


def _parse_regular(source: Source) -> Array | None:
    """The frames of a file with the usual layout, several times faster than through JSON; else None."""
    head, _, body = source.text.partition('"Frames"')
    rows = body.replace("\n", " ").split("]")
    # After the last row: the ends of the list and of the object.
    if '"' in body or head.count("[") or len(rows) < 3 or [end.strip() for end in rows[-2:]] != ["", "}"]:
        return None
    rows = rows[:-2]
    row_starts = [row.partition("[") for row in rows]
    first = row_starts[0][2].partition("[")
    if (
        row_starts[0][0].strip() != ":"
        or first[0].strip()
        or any(row[0].strip() != "," for row in row_starts[1:])
    ):
        return None
    try:
        lines = [first[2], *(row[2] for row in row_starts[1:])]
        frames = np.loadtxt(lines, dtype=np.float64, delimiter=",", comments=None, ndmin=2)
    except ValueError:
        return None
    return frames if frames.shape == (len(rows), COLUMNS) else None


def _parse_as_json(source: Source) -> Array:
    """The frames of any JSON layout; CaptureError says what is wrong with them."""
    content: Any = parse_json(source)
    rows = content.get("Frames") if isinstance(content, dict) else None
    if not isinstance(rows, list) or not rows:
        raise source.error(expected='"Frames" with two frames or more', found="none")
    for number, row in enumerate(rows):
        if not isinstance(row, list) or len(row) != COLUMNS:
            count = len(row) if isinstance(row, list) else type(row).__name__
            raise source.error(
                expected=f"{COLUMNS} numbers", found=f"{count}", where=f"frame {number}",
                advice="only the humanoid with 44 numbers per frame is supported",
            )  # fmt: skip
    frames = numbers(rows)
    if frames is None or frames.ndim != 2:
        raise source.error(expected="numbers only", found="something else in a frame")
    return frames
