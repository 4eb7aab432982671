"""The captured skeleton next to a rollout, as read: unfiltered and with its gaps.

Capture and rollout share no clock: a captured frame is shown when the rollout's reference has the same phase.
The passes of a walk follow one another, each over as many cycles as it lasts.

Each pass is scaled to the humanoid's legs and then, as a whole, rotated about the vertical, shifted and moved
at a constant velocity to fit the legs of the reference. Motion within a pass is unchanged. The velocity
compensates for a treadmill, and for the different step length of another body.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from kinemimic.evaluate.film.figures import CAPTURED, Humanoid
from kinemimic.evaluate.view.scene import SCENES, entity_path, time_columns
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.convert import on_nodes
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.store import read_clip
from kinemimic.pipeline.files.validation.tables import numbers, read_table
from kinemimic.pipeline.kinematics.skeleton import INFERRED, MISSING, NODE_INDEX, NODES, SIDES, TRACKED
from kinemimic.retarget.feet.scale import length_scale

LEGS = [NODE_INDEX[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle") for side in SIDES]
# Colour (red, green, blue, opacity) and radius in metres of a joint. Inferred joints are larger than the
# bones, in a colour that no humanoid has.
LOOKS = {TRACKED: (0xF0F0F0FF, 0.018), INFERRED: (0xFF50C8FF, 0.028), MISSING: (0, 0.0)}


@dataclass(frozen=True)
class CapturedSkeleton:
    """M captured frames in the time and world of a recording.

    times: (M,) seconds, increasing; positions: (M, 20, 3) of the nodes in metres, NaN where missing; states:
    (M, 20) as in `Clip`; passes: (M,) pass number of each frame; of: number of passes in the motion, some of
    which may not fit into the rollout.
    """

    times: Array
    positions: Array
    states: NDArray[np.uint8]
    passes: NDArray[np.int32]
    of: int

    def legend(self) -> str:
        """Markdown legend."""
        return (
            f"Capture as read, unfiltered: {len(np.unique(self.passes))} of {self.of} passes, each aligned "
            "with the reference as a whole. White: tracked; pink: inferred; missing joints are not drawn."
        )


def captured_skeleton(
    run: Path, phases: Array, frame_times: Array, reference: Humanoid, *, cyclic: bool
) -> CapturedSkeleton | None:
    """The capture of a run folder on the time axis of a rollout; None if there is no capture.

    phases, frame_times: (F,) the reference's phase and the recording's seconds at each frame; reference: the
    humanoid that the passes are aligned with; cyclic: whether the motion's phases recur in every cycle.
    """
    if not all((run / name).exists() for name in ("raw.parquet", "capture.parquet")):
        return None
    raw = on_nodes(read_clip(run / "raw.parquet"))
    time, passes, phase = _frames_with_phase(run / "capture.parquet")
    rows = np.minimum(np.searchsorted(raw.times, time), len(raw.times) - 1)
    if not np.array_equal(raw.times[rows], time):
        raise CaptureError(
            run / "capture.parquet",
            expected="frames of raw.parquet",
            found="others",
            advice="run retarget again",
        )
    scale = length_scale(raw.positions[rows])
    where = CubicSpline(phases, reference.positions)
    numbers = list(dict.fromkeys(passes.tolist()))
    shown: list[tuple[Array, Array, NDArray[np.intp]]] = []
    begin = phases[0]
    for number in numbers:
        own = np.flatnonzero(passes == number)
        at = phase[own] + (np.ceil(begin - phase[own[0]]) if cyclic else 0.0)
        inside = (at >= phases[0]) & (at <= phases[-1])
        if not inside.any():
            break
        begin, own, at = at[-1], own[inside], at[inside]
        seconds = np.interp(at, phases, frame_times)
        laid = aligned(where(at), scale * raw.positions[rows[own]], seconds)
        shown.append((seconds, laid, own))
    if not shown:
        return None
    seconds, positions, kept = (np.concatenate(part) for part in zip(*shown, strict=True))
    states = np.where(np.isfinite(positions).all(axis=-1), raw.states[rows[kept]], MISSING)
    return CapturedSkeleton(seconds, positions, states.astype(np.uint8), passes[kept], len(numbers))


def _frames_with_phase(path: Path) -> tuple[Array, NDArray[np.int32], Array]:
    """Time in seconds, pass number and phase of the captured frames in the motion."""
    kind, advice = "captured frames", "run retarget again"
    table, _ = read_table(path, kind=kind, advice=advice)
    try:
        time, passes, phase = (numbers(table, name, "fiu") for name in ("time", "pass", "phase"))
        # Schema 1 has only frames that went into the motion.
        used = numbers(table, "used", "b") if "used" in table.column_names else np.isfinite(phase)
    except ValueError as error:
        raise CaptureError(path, expected=kind, found=str(error), advice=advice) from None
    has_phase = np.isfinite(phase) & used
    return time[has_phase], passes[has_phase], phase[has_phase]


def aligned(target: Array, points: Array, seconds: Array) -> Array:
    """Points (N, 20, 3) rotated about the vertical, shifted and moved at a constant velocity so that their
    legs fit those of the target (N, 20, 3) in the least-squares sense; seconds: (N,)."""
    seen = np.isfinite(points[:, LEGS]).all(axis=-1)
    if not seen.any():
        return points
    # In the complex plane, a rotation about the vertical is a factor, which makes the fit linear.
    flat, onto = (one[..., 0] + 1j * one[..., 1] for one in (points, target))
    since = seconds - seconds.mean()
    elapsed = np.broadcast_to(since[:, None], seen.shape)[seen]
    drift = np.stack([np.ones(len(elapsed)), elapsed], axis=-1)
    legs, goals = flat[:, LEGS][seen], onto[:, LEGS][seen]
    turn = np.linalg.lstsq(np.column_stack([legs, drift]), goals, rcond=None)[0][0]
    turn /= max(abs(turn), np.finfo(float).tiny)
    start, velocity = np.linalg.lstsq(drift.astype(complex), goals - turn * legs, rcond=None)[0]
    moved = turn * flat + start + velocity * since[:, None]
    height = points[..., 2] + np.mean((target - points)[:, LEGS, 2][seen])
    return np.stack([moved.real, moved.imag, height], axis=-1)


def log_skeleton(stream: rr.RecordingStream, shown: CapturedSkeleton) -> None:
    """Log the captured skeleton in both scenes, without missing joints and without frames between passes."""
    frames, nodes = shown.states.shape
    # An empty frame ends each pass; otherwise its last frame would stay visible until the next pass.
    lasts = np.flatnonzero(np.append(np.diff(shown.passes) != 0, True))
    step = float(np.median(np.diff(shown.times))) if frames > 1 else 0.0
    times = time_columns(np.insert(shown.times, lasts + 1, shown.times[lasts] + step))
    lengths = np.insert(np.full(frames, nodes), lasts + 1, 0)
    looks = [LOOKS[state] for state in sorted(LOOKS)]
    columns = rr.Points3D.columns(
        positions=shown.positions.reshape(-1, 3).astype(np.float32),
        colors=np.array([color for color, _ in looks], np.uint32)[shown.states].ravel(),
        radii=np.array([radius for _, radius in looks], np.float32)[shown.states].ravel(),
    ).partition(lengths)
    keypoints = rr.Points3D.from_fields(
        class_ids=[CAPTURED], keypoint_ids=list(range(len(NODES))), show_labels=False
    )
    for scene in SCENES:
        place = f"{entity_path(scene, CAPTURED)}/skeleton"
        stream.log(place, keypoints, static=True)
        stream.send_columns(place, times, columns)
