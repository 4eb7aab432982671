"""A laboratory's markers on the known walk in a MAT-file, as QTM and the MoCap Toolbox store them."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from scipy.io import savemat

from kinemimic.pipeline.arrays import Array
from samples.qualisys_tsv import MARKERS, RATE, points


def saved(*, compressed: bool = True, **variables: Any) -> bytes:
    """As a MAT-file."""
    buffer = io.BytesIO()
    savemat(buffer, variables, do_compression=compressed, long_field_names=True)
    return buffer.getvalue()


def cells(names: list[str]) -> Any:
    """A row of a cell array of text."""
    found = np.empty((1, len(names)), dtype=object)
    found[0, :] = names
    return found


def qtm(labels: list[str], places: Array, **more: Any) -> dict[str, Any]:
    """QTM's structure; places: (T, M, 3) mm, NaN where not seen."""
    errors = np.ones((*places.shape[:2], 1))
    labelled = {
        "Count": float(len(labels)),
        "Labels": cells(labels),
        "Data": np.moveaxis(np.concatenate([places, errors], axis=-1), 0, -1),
        "Type": np.ones((len(labels), len(places)), dtype=np.uint8),
    }
    return {
        "File": "C:\\walk.qtm",
        "Timestamp": "2026-01-19, 10:19:43",
        "StartFrame": 1.0,
        "Frames": float(len(places)),
        "FrameRate": RATE,
        "Trajectories": {"Labeled": labelled, "Unidentified": {"Count": 0.0}},
        **more,
    }


def toolbox(labels: list[str], places: Array) -> dict[str, Any]:
    """The MoCap Toolbox's structure; places as in `qtm`."""
    return {
        "type": "MoCap data",
        "filename": "walk.tsv",
        "nFrames": float(len(places)),
        "nCameras": 8.0,
        "nMarkers": float(len(labels)),
        "freq": RATE,
        "markerName": cells(labels).T,
        "data": places.reshape(len(places), -1),
        "other": {"quality": []},
    }


def files(frames: int = 90) -> dict[str, bytes]:
    """One file."""
    return {"walk.mat": saved(walk=qtm(list(MARKERS), 1000.0 * points(frames)))}
