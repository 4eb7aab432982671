"""Write OpenSim's marker files (.trc): a clip's joints as markers, in millimetres."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kinemimic.pipeline.files.store import write_text
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.rotations import conjugate, rotate
from kinemimic.pipeline.readers.opensim.trc import WORLD_FROM_FILE


def write_trc(path: Path, clip: Clip) -> None:
    """Write a clip's positions, each marker named after its joint; X forward, Y up, Z right.

    A joint that is missing in a frame leaves its three cells empty, as OpenSim expects. Times are the clip's,
    from 0.
    """
    times = clip.times - clip.times[0]
    points = 1000.0 * rotate(conjugate(WORLD_FROM_FILE), clip.positions)
    labels = ["_".join(name.split()) for name in clip.skeleton.names]
    frames, rate = len(times), f"{clip.rate:.6g}"
    header = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate}\t{rate}\t{frames}\t{len(labels)}\tmm\t{rate}\t1\t{frames}",
        "Frame#\tTime\t" + "\t\t\t".join(labels) + "\t\t",
        "\t\t" + "\t".join(f"X{k}\tY{k}\tZ{k}" for k in range(1, len(labels) + 1)),
        "",
    ]
    row_format = "\t".join(["%d\t%.6f", *["%.5f"] * (3 * len(labels))])
    rows = [
        row_format % (frame, time, *row)
        for frame, time, row in zip(
            range(1, frames + 1), times.tolist(), points.reshape(frames, -1).tolist(), strict=True
        )
    ]
    if np.isnan(points).any():
        rows = [row.replace("nan", "") for row in rows]
    write_text(path, "\n".join([*header, *rows]) + "\n")
