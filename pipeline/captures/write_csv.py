"""Writes tables (.csv): a row a frame with places, rotations and leg angles."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.store import write_text

Array = NDArray[np.float64]


def write_csv(path: Path, clip: Clip, angles: Mapping[str, Array]) -> None:
    """Write a clip's frames; a joint or an angle that is missing leaves its cells empty.

    angles: curves (T,) in radians by name. The header's names end in the unit:
    time_s; root_x_m, root_y_m, root_z_m, the first joint's place; per joint <name>_x_m … in the world (Z up,
    X forward, Y left) and, where the clip has rotations, <name>_qx, _qy, _qz, _qw, child to parent (the
    root's in the world); per angle <name>_deg, flexion positive.
    """
    columns: dict[str, Array] = {"time_s": clip.times}
    decimals = ["%.6f"]
    for joint, name in enumerate(("root", *clip.skeleton.names)):
        place = max(joint - 1, 0)
        columns |= {f"{name}_{axis}_m": clip.positions[:, place, k] for k, axis in enumerate("xyz")}
        decimals += ["%.6f"] * 3
        if joint and clip.rotations is not None:
            columns |= {f"{name}_q{axis}": clip.rotations[:, place, k] for k, axis in enumerate("xyzw")}
            decimals += ["%.8f"] * 4
    columns |= {f"{name}_deg": np.degrees(curve) for name, curve in angles.items()}
    decimals += ["%.4f"] * len(angles)
    head = io.StringIO()
    csv.writer(head, lineterminator="\n").writerow(columns)  # quotes a name that has a comma in it
    form = ",".join(decimals)
    lines = [form % tuple(row) for row in np.stack(list(columns.values()), axis=1).tolist()]
    write_text(path, head.getvalue() + "\n".join(lines).replace("nan", "") + "\n")
