"""A table of Plug-in-Gait markers on the known walk, as PyMoCapViewer's example: semicolons, mm, no times."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.readers.joint_tables.marker_csv import RATE
from kinemimic.pipeline.readers.public_datasets.uiprmd_vicon import MARKERS
from samples.motion import in_sight, walk
from samples.uiprmd_vicon import plug_in_gait


def files(frames: int = 90) -> dict[str, bytes]:
    """One file."""
    places = plug_in_gait(in_sight(walk(frames, RATE)))
    points = 1000.0 * np.stack([places[label] for label in MARKERS], axis=1)
    names = [f"{label} ({axis})" for label in MARKERS for axis in "xyz"]
    lines = [";".join(f"{value:.6f}" for value in row) for row in points.reshape(frames, -1)]
    return {"vicon.csv": ("\n".join([";".join(names), *lines]) + "\n").encode()}
