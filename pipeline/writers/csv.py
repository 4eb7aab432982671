"""Write tables (.csv): one row per frame with positions, rotations and leg angles."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.store import write_text
from kinemimic.pipeline.kinematics.clip import Clip


def write_csv(path: Path, clip: Clip, angles: Mapping[str, Array]) -> None:
    """Write a clip's frames; a joint or an angle that is missing leaves its cells empty.

    angles: curves (T,) in radians by name. The header's names end in the unit:
    time_s; root_x_m, root_y_m, root_z_m, the first joint's position again, unless a joint is called root (as
    AMC's first one is); per joint <name>_x_m … in the world (Z up,
    X forward, Y left) and, where the clip has rotations, <name>_qx, _qy, _qz, _qw, child to parent (the
    root's in the world); per angle <name>_deg, flexion positive.
    """
    columns: dict[str, Array] = {"time_s": clip.times}
    formats = ["%.6f"]
    if "root" not in clip.skeleton.names:
        columns |= _position_columns("root", clip.positions[:, 0])
        formats += ["%.6f"] * 3
    for joint, name in enumerate(clip.skeleton.names):
        columns |= _position_columns(name, clip.positions[:, joint])
        formats += ["%.6f"] * 3
        if clip.rotations is not None:
            columns |= {f"{name}_q{axis}": clip.rotations[:, joint, k] for k, axis in enumerate("xyzw")}
            formats += ["%.8f"] * 4
    columns |= {f"{name}_deg": np.degrees(curve) for name, curve in angles.items()}
    formats += ["%.4f"] * len(angles)
    header = io.StringIO()
    csv.writer(header, lineterminator="\n").writerow(columns)  # quotes a name that has a comma in it
    row_format = ",".join(formats)
    lines = [row_format % tuple(row) for row in np.stack(list(columns.values()), axis=1).tolist()]
    write_text(path, header.getvalue() + "\n".join(lines).replace("nan", "") + "\n")


def _position_columns(name: str, positions: Array) -> dict[str, Array]:
    return {f"{name}_{axis}_m": positions[:, k] for k, axis in enumerate("xyz")}
