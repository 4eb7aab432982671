"""The angles that were captured, frame by frame beside the phase of the motion: capture.parquet.

A score against these, which no filter, pooling or loop has touched, is a score against the recording. Where
its pelvis or the side-ways position of its knees is not to be believed (trust.py), what is neutral in the
motion is neutral here, so that both speak of the same angle.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from kinemimic.pipeline.angles import ANGLES
from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.orient import local_rotations
from kinemimic.pipeline.rotations import from_axis_angle, rotate
from kinemimic.pipeline.store import atomic
from kinemimic.retarget.motion import joint_angles
from kinemimic.retarget.trust import Trust, believed_frames

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Span:
    """The part of a pass that became the motion: `start` to `end` seconds, heading in radians; the motion's
    phase is (time - zero) / duration."""

    number: int
    start: float
    end: float
    heading: float
    zero: float
    duration: float


def captured_angles(
    clip: Clip, raw: Clip, spans: list[Span], trust: Trust, truth: Mapping[str, Array] | None
) -> dict[str, Array]:
    """Columns of capture.parquet, one row a raw frame within a span.

    clip, raw: on the 20 nodes, cleaned and as read; truth: "time" and the angles on the same clock. The same
    parts of the body are believed as in the motion, so that both speak of the same angle.
    """
    parts: list[dict[str, Array]] = []
    for span in spans:
        rows = np.flatnonzero(
            (raw.passes == span.number) & (raw.times >= span.start) & (raw.times <= span.end)
        )
        kept = np.flatnonzero(
            (clip.passes == span.number) & (clip.times >= span.start) & (clip.times <= span.end)
        )
        times = raw.times[rows]
        part: dict[str, Array] = {
            "time": times,
            "pass": np.full(len(rows), span.number, dtype=np.int32),
            "phase": (times - span.zero) / span.duration,
        }
        part |= _angles(raw.positions[rows], span.heading, trust)
        for name, curve in _angles(clip.positions[kept], span.heading, trust).items():
            part[f"clean_{name}"] = np.interp(times, clip.times[kept], curve)
        if truth is not None:
            for name in ANGLES:
                part[f"truth_{name}"] = np.interp(times, truth["time"], truth[name])
        parts.append(part)
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _angles(positions: Array, heading: float, trust: Trust) -> dict[str, Array]:
    ahead = rotate(from_axis_angle("Z", -heading), positions)
    return joint_angles(local_rotations(believed_frames(ahead, trust)))


def read_truth(path: Path) -> dict[str, Array] | None:
    """The truth of a simulated capture; None where there is none."""
    if not path.exists():
        return None
    try:
        table = pq.read_table(path, columns=["time", *ANGLES])
    except (pa.ArrowInvalid, KeyError) as error:
        raise CaptureError(path, expected="a truth file", found=str(error).splitlines()[0]) from None
    return {name: table[name].to_numpy() for name in table.column_names}


def write_captured(path: Path, columns: Mapping[str, Array], provenance: Mapping[str, Any]) -> None:
    """Write capture.parquet atomically."""
    table = pa.table(dict(columns)).replace_schema_metadata({"kinemimic": json.dumps(dict(provenance))})
    with atomic(path) as temporary:
        pq.write_table(table, temporary, compression="zstd")
