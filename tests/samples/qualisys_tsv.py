"""A laboratory's markers on the known walk as Qualisys Track Manager exports them, in mm."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from samples.motion import in_sight, walk
from samples.uiprmd_vicon import MARKERS, plug_in_gait

RATE = 100.0


def points(frames: int) -> Array:
    """(T, M, 3) metres of MARKERS."""
    places = plug_in_gait(in_sight(walk(frames, RATE)))
    return np.stack([places[label] for label in MARKERS], axis=1)


def text(labels: list[str], places: Array, *, columns: bool = True) -> str:
    """The file; places: (T, M, 3) mm, NaN where not seen; columns: with names, frames and times."""
    head = [
        f"NO_OF_FRAMES\t{len(places)}",
        "NO_OF_CAMERAS\t10",
        f"NO_OF_MARKERS\t{len(labels)}",
        f"FREQUENCY\t{RATE:g}",
        "NO_OF_ANALOG\t0",
        "DESCRIPTION\t--",
        "TIME_STAMP\t2026-01-19, 10:19:43.755\t2063631.96175450",
        "DATA_INCLUDED\t3D",
        "MARKER_NAMES\t" + "\t".join(labels),
    ]
    if columns:
        names = [f"{label} {axis}" for label in labels for axis in "XYZ"]
        head += [
            "TRAJECTORY_TYPES\t" + "\t".join(["Measured"] * len(labels)),
            "\t".join(["Frame", "Time", *names]) + "\t",
        ]
    rows = []
    for frame, row in enumerate(places.reshape(len(places), -1)):
        cells = ["" if np.isnan(value) else f"{value:.3f}" for value in row]
        rows.append("\t".join([f"{frame + 1}", f"{frame / RATE:.5f}", *cells] if columns else cells))
    return "\n".join([*head, *rows]) + "\n"


def files(frames: int = 90) -> dict[str, bytes]:
    """One file."""
    return {"walk.tsv": text(list(MARKERS), 1000.0 * points(frames)).encode()}
