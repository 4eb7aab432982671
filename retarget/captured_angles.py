"""The recorded joint angles, frame by frame, with their phase in the motion: capture.parquet.

They are neither filtered nor averaged over strides, so a score against them is a score against the recording.
Where the recorded pelvis or the lateral position of the knees is unreliable (`sensor_reliability`), the
neutral pose of the motion is used here too, so that both describe the same angle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.store import write_table
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.orient import local_rotations
from kinemimic.pipeline.kinematics.rotations import continuous, normalize, rotate
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.retarget.strides.sensor_reliability import SensorReliability, reliable_frames

CAPTURED_SCHEMA = 1


@dataclass(frozen=True)
class PassSpan:
    """The part of a pass that became the motion.

    times: (n,) seconds of its frames; turn: (n, 4) rotations from the capture's axes to the walker's; phase:
    (n,) of the motion, in cycles.
    """

    number: int
    times: Array
    turn: Array
    phase: Array

    def at(self, times: Array) -> tuple[Array, Array]:
        """Rotations (T, 4) and phases (T,) at times (T,) within the span."""
        turn = np.stack([np.interp(times, self.times, column) for column in continuous(self.turn).T], axis=1)
        return normalize(turn), np.interp(times, self.times, self.phase)


def captured_angles(
    clip: Clip,
    raw: Clip,
    spans: list[PassSpan],
    reliability: SensorReliability,
    truth: Mapping[str, Array] | None,
) -> dict[str, Array]:
    """Columns of capture.parquet, one row per raw frame within a span.

    clip, raw: on the 20 nodes, cleaned and as read; reliability: of the motion's fit; truth: "time" and the
    true angles on the same clock.
    """
    rows, kept = ([_within(one, span) for span in spans] for one in (raw, clip))
    measured, cleaned = (
        _angles(one, frames, spans, reliability) for one, frames in ((raw, rows), (clip, kept))
    )
    parts: list[dict[str, Array]] = []
    for k, span in enumerate(spans):
        times = raw.times[rows[k]]
        part: dict[str, Array] = {
            "time": times,
            "pass": np.full(len(times), span.number, dtype=np.int32),
            "phase": span.at(times)[1],
        }
        part |= measured[k]
        for name, curve in cleaned[k].items():
            part[f"clean_{name}"] = np.interp(times, clip.times[kept[k]], curve)
        if truth is not None:
            for name in ANGLES:
                part[f"truth_{name}"] = np.interp(times, truth["time"], truth[name])
        parts.append(part)
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _within(clip: Clip, span: PassSpan) -> NDArray[np.intp]:
    first, last = span.times[[0, -1]]
    inside = (clip.passes == span.number) & (clip.times >= first) & (clip.times <= last)
    return np.flatnonzero(inside)


def _angles(
    clip: Clip, frames: list[NDArray[np.intp]], spans: list[PassSpan], reliability: SensorReliability
) -> list[dict[str, Array]]:
    """The angle curves of each span, computed in one batch: an hour of recording has a thousand passes."""
    turns = [span.at(clip.times[one])[0] for span, one in zip(spans, frames, strict=True)]
    ahead = rotate(np.concatenate(turns)[:, None], clip.positions[np.concatenate(frames)])
    curves = joint_angles(local_rotations(reliable_frames(ahead, reliability)))
    ends = np.cumsum([len(one) for one in frames])[:-1]
    pieces = {name: np.split(curve, ends) for name, curve in curves.items()}
    return [{name: pieces[name][k] for name in pieces} for k in range(len(spans))]


def write_captured(path: Path, columns: Mapping[str, Array], provenance: Mapping[str, Any]) -> None:
    """Write capture.parquet atomically."""
    write_table(path, columns, {"schema": CAPTURED_SCHEMA, **provenance})
