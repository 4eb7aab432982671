"""The recorded joint angles, frame by frame, with their phase in the motion: capture.parquet.

They are neither filtered nor averaged over strides, and the pelvis and the knees are where the sensor saw
them, so a score against them is a score against the recording. The adjusted angles beside them are of the
same frames with the neutral pelvis and the projected knees that the motion has where the recorded ones are
unreliable (`sensor_reliability`).
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
from kinemimic.pipeline.kinematics.orientation.from_positions import local_rotations, node_frames
from kinemimic.pipeline.kinematics.rotations import continuous, normalize, rotate
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.retarget.strides.sensor_reliability import SensorReliability, reliable_frames

CAPTURED_SCHEMA = 2


@dataclass(frozen=True)
class PassSpan:
    """The part of a pass that became the motion.

    times: (n,) seconds of its frames; turn: (n, 4) rotations from the capture's axes to the walker's; phase:
    (n,) of the motion, in cycles; used: (n,) whether a frame was pooled, None if all were.
    """

    number: int
    times: Array
    turn: Array
    phase: Array
    used: NDArray[np.bool_] | None = None

    def at(self, times: Array) -> tuple[Array, Array]:
        """Rotations (T, 4) and phases (T,) at times (T,); beyond the span its end's rotation, and NaN."""
        turn = np.stack([np.interp(times, self.times, column) for column in continuous(self.turn).T], axis=1)
        return normalize(turn), np.interp(times, self.times, self.phase, left=np.nan, right=np.nan)

    def pooled(self, times: Array) -> NDArray[np.bool_]:
        """(T,) whether the frame nearest to each time was pooled; False beyond the span."""
        first, last = self.times[[0, -1]]
        inside = (times >= first) & (times <= last)
        if self.used is None:
            return np.asarray(inside, dtype=np.bool_)
        middles = 0.5 * (self.times[1:] + self.times[:-1])
        return np.asarray(inside & self.used[np.searchsorted(middles, times)], dtype=np.bool_)


def captured_angles(
    clip: Clip,
    raw: Clip,
    spans: list[PassSpan],
    reliability: SensorReliability,
    truth: Mapping[str, Array] | None,
) -> dict[str, NDArray[Any]]:
    """Columns of capture.parquet, one row per raw frame of the spans' passes; used: pooled into the motion.

    Between and beyond the spans of a pass, the phase is NaN.

    clip, raw: on the 20 nodes, cleaned and as read; reliability: of the motion's fit; truth: "time" and the
    true angles on the same clock.
    """
    rows, kept = (_frames(one, spans) for one in (raw, clip))
    read = _angles(raw, rows, spans, None)
    adjusted, cleaned = (
        _angles(one, frames, spans, reliability) for one, frames in ((raw, rows), (clip, kept))
    )
    parts: list[dict[str, NDArray[Any]]] = []
    for k, span in enumerate(spans):
        times = raw.times[rows[k]]
        part: dict[str, NDArray[Any]] = {
            "time": times,
            "pass": np.full(len(times), span.number, dtype=np.int32),
            "phase": span.at(times)[1],
            "used": span.pooled(times),
            **read[k],
            **{f"adjusted_{name}": curve for name, curve in adjusted[k].items()},
        }
        for name, curve in cleaned[k].items():
            # A segment leaves the rest of the pass out of the cleaned clip.
            part[f"clean_{name}"] = np.interp(times, clip.times[kept[k]], curve, left=np.nan, right=np.nan)
        if truth is not None:
            for name in ANGLES:
                part[f"truth_{name}"] = np.interp(times, truth["time"], truth[name])
        parts.append(part)
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _frames(clip: Clip, spans: list[PassSpan]) -> list[NDArray[np.intp]]:
    """The frames of each span; the first of a pass also has those of the pass that are in no span."""
    within = [
        (clip.passes == one.number) & (clip.times >= one.times[0]) & (clip.times <= one.times[-1])
        for one in spans
    ]
    free = ~np.any(within, axis=0)
    for k, span in enumerate(spans):
        within[k] |= free & (clip.passes == span.number)
        free &= ~within[k]
    return [np.flatnonzero(one) for one in within]


def _angles(
    clip: Clip, frames: list[NDArray[np.intp]], spans: list[PassSpan], reliability: SensorReliability | None
) -> list[dict[str, Array]]:
    """The angle curves of each span, computed in one batch: an hour of recording has a thousand passes.

    reliability: None for the angles of the nodes as they are.
    """
    turns = [span.at(clip.times[one])[0] for span, one in zip(spans, frames, strict=True)]
    ahead = rotate(np.concatenate(turns)[:, None], clip.positions[np.concatenate(frames)])
    world = node_frames(ahead) if reliability is None else reliable_frames(ahead, reliability)
    curves = joint_angles(local_rotations(world))
    ends = np.cumsum([len(one) for one in frames])[:-1]
    pieces = {name: np.split(curve, ends) for name, curve in curves.items()}
    return [{name: pieces[name][k] for name in pieces} for k in range(len(spans))]


def write_captured(path: Path, columns: Mapping[str, NDArray[Any]], provenance: Mapping[str, Any]) -> None:
    """Write capture.parquet atomically."""
    write_table(path, columns, {"schema": CAPTURED_SCHEMA, **provenance})
