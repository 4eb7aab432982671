"""OpenSim's inverse kinematics of the known walk, in the columns and the layout of the model gait2354."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import conjugate, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers.opensim.mot import WORLD_FROM_FILE
from samples.motion import rigid_walk


def columns(frames: int) -> dict[str, Array]:
    """Coordinates (T,) by name, in degrees and metres."""
    walk = rigid_walk(frames, 60.0)
    turns = multiply(multiply(conjugate(WORLD_FROM_FILE), walk.rotations), WORLD_FROM_FILE)

    def angles(node: str) -> Array:
        return np.asarray(Rotation.from_quat(turns[:, NODE_INDEX[node]]).as_euler("ZXY", degrees=True)).T

    made = dict(zip(("pelvis_tilt", "pelvis_list", "pelvis_rotation"), angles("hip_center"), strict=True))
    # The pelvis' origin lies before and above the hips' middle.
    middle = rotate(conjugate(WORLD_FROM_FILE), walk.root)
    origin = middle - rotate(turns[:, 0], np.array([-0.0707, -0.0661, 0.0]))
    made |= {f"pelvis_t{axis}": place for axis, place in zip("xyz", origin.T, strict=True)}
    for side, s, mirror in (("right", "r", 1.0), ("left", "l", -1.0)):
        flexion, adduction, rotation = angles(f"hip_{side}")
        made |= {f"hip_flexion_{s}": flexion, f"hip_adduction_{s}": mirror * adduction}
        made |= {f"hip_rotation_{s}": mirror * rotation, f"knee_angle_{s}": angles(f"knee_{side}")[0]}
        made |= {f"ankle_angle_{s}": angles(f"ankle_{side}")[0], f"subtalar_angle_{s}": 0.0 * flexion}
    lumbar = ("lumbar_extension", "lumbar_bending", "lumbar_rotation")
    return made | dict(zip(lumbar, angles("spine"), strict=True))


def written(table: dict[str, Array], *, degrees: bool = True) -> bytes:
    """The text of a .mot file."""
    frames = len(table["knee_angle_r"])
    lines = ["Coordinates", "version=1", f"nRows={frames}", f"nColumns={len(table) + 1}"]
    lines += [f"inDegrees={'yes' if degrees else 'no'}", "", "Units are S.I. units", "", "endheader"]
    lines.append("\t".join(["time", *table]))
    rows = np.stack([np.arange(frames) / 60.0, *table.values()], axis=1)
    lines += ["\t".join(f"{value:20.8f}" for value in row) for row in rows]
    return ("\n".join(lines) + "\n").encode()


def files(frames: int = 90) -> dict[str, bytes]:
    """walk_ik.mot."""
    return {"walk_ik.mot": written(columns(frames))}
