"""The virtual Kinect's recorder: a person's optical capture as a Kinect v1 would record it, with its truth.

The stock walk (or run) makes several passes before a simulated sensor, oblique to its line of sight, and is
written in two forms: the v1 recorder's `.skl` text, and BVH with the Euler angles of Eq. 8. Next to each are
NAME.truth.parquet and NAME.provenance.json, which marks it as simulated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array, Mask, States
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.sidecars import note_path, truth_path, write_note, write_truth
from kinemimic.pipeline.files.store import file_hash
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion
from kinemimic.pipeline.virtual_kinect.camera import Camera
from kinemimic.pipeline.virtual_kinect.euler_bvh import write_euler_bvh
from kinemimic.pipeline.virtual_kinect.noise import NoiseLevels, Observation, observe
from kinemimic.pipeline.virtual_kinect.subject import Gait, GroundTruth, close_loop, ground_truth
from kinemimic.pipeline.writers.skl import write_skl

RATE = 30.0
# In seconds, as written in the BVH; the truth of that form is on this clock.
FRAME_TIME = 0.03333333
# Start and end of the passes on the floor: metres in front of the sensor, metres to its left. All approach
# the sensor, from frontal to almost sideways, within its range (4.2 m to about 1.7 m).
PATHS: tuple[tuple[tuple[float, float], tuple[float, float]], ...] = (
    ((4.1, 1.7), (2.1, -0.9)),
    ((4.1, -1.7), (2.1, 0.9)),
    ((4.2, 0.9), (1.7, -0.3)),
    ((4.2, -0.9), (1.7, 0.3)),
    ((3.5, 1.6), (2.5, -1.2)),
    ((3.5, -1.6), (2.5, 1.2)),
)
# The set of passes is repeated until this many seconds are recorded: runners cross the view in one second.
MIN_DURATION = 15.0
# The recorder's clock ticks every 4 ms, so 30 Hz shows as steps of 32 and 36 ms; some frames are dropped.
_CLOCK_TICK = 4
_CLOCK_JITTER = 1.0
_CLOCK_START = 1_000_000
_DROPPED = 0.015
_ABSENCE = (3.0, 7.0)
# A recorder without a clock repeats the last pose for 0.7 s (frames) when the subject has left.
_REPEATED_FRAMES = 21


class Recording(NamedTuple):
    """The files of the two forms: text of the v1 recorder, and BVH with Euler angles."""

    skl: Path
    euler: Path


@dataclass(frozen=True)
class Pass:
    """One walk past the sensor: start_time (s), start (2,), heading (rad), phase (cycles) and frames."""

    start_time: float
    start: Array
    heading: float
    phase: float
    frames: int


@dataclass(frozen=True)
class Session:
    """All that both forms of a recording share."""

    gait: Gait
    passes: list[Pass]
    camera: Camera
    levels: NoiseLevels


@dataclass(frozen=True)
class Recorded:
    """All passes joined: frames: (N,) numbers of the sensor's frames; lengths: frames of each pass; positions
    (N, 20, 3), states (N, 20), swapped (N,): as in Observation; angles: the true curves (N,) by name."""

    frames: NDArray[np.int64]
    lengths: list[int]
    positions: Array
    states: States
    swapped: Mask
    angles: dict[str, Array]


def record_virtual(
    folder: Path,
    *,
    motion: str = "walk",
    seed: int = 0,
    camera: Camera | None = None,
    levels: NoiseLevels | None = None,
) -> Recording:
    """Record a stock motion of the pybullet wheel: `kinect_<motion>.skl` and `kinect_<motion>_euler.bvh`.

    The same seed gives the same bytes. The two forms show the same passes with independent noise.
    """
    camera, levels = camera or Camera(), levels or NoiseLevels()
    source = stock_motion(motion)
    gait = close_loop(read_deepmimic(source))
    passes = plan_passes(gait, np.random.default_rng([seed, 0]))
    note = {
        "simulated": True,
        "sensor": "virtual Kinect v1",
        "motion": motion,
        "virtual_kinect": {
            **provenance(
                "virtual",
                inputs={source.name: file_hash(source)},
                config={
                    "camera": asdict(camera),
                    "levels": asdict(levels),
                    "rate": RATE,
                    "passes": len(passes),
                },
                seed=seed,
            ),
            "speed": round(gait.speed, 6),
            "period": round(gait.period, 6),
        },
    }
    skl, euler = folder / f"kinect_{motion}.skl", folder / f"kinect_{motion}_euler.bvh"
    session = Session(gait, passes, camera, levels)
    _write_skl_form(skl, session, np.random.default_rng([seed, 1]), note)
    _write_euler_form(euler, session, np.random.default_rng([seed, 2]), note)
    return Recording(skl, euler)


def plan_passes(gait: Gait, rng: np.random.Generator) -> list[Pass]:
    """The passes over PATHS, each starting at a random phase, with absences in between."""
    passes: list[Pass] = []
    clock = total = 0.0
    while total < MIN_DURATION:
        for start, end in np.array(PATHS):
            path = end - start
            duration = float(np.hypot(*path)) / gait.speed
            heading = float(np.arctan2(path[1], path[0]))
            frames = int(duration * RATE) + 1
            passes.append(Pass(clock, start, heading, float(rng.random()), frames))
            clock += duration + float(rng.uniform(*_ABSENCE))
            total += duration
    return passes


def _record(
    session: Session, received: Callable[[int], NDArray[np.bool_]], rng: np.random.Generator
) -> Recorded:
    """The passes as recorded; received: number of frames of a pass -> which the recorder did not drop."""
    frames: list[NDArray[np.int64]] = []
    truths: list[GroundTruth] = []
    seen: list[Observation] = []
    for one in session.passes:
        numbers = np.flatnonzero(received(one.frames))
        elapsed = numbers / RATE
        truth = ground_truth(session.gait, elapsed, start=one.start, heading=one.heading, phase=one.phase)
        frames.append((numbers + round(one.start_time * RATE)).astype(np.int64))
        truths.append(truth)
        seen.append(observe(truth.joints, truth.heading, elapsed, session.camera, session.levels, rng))
    return Recorded(
        frames=np.concatenate(frames),
        lengths=[len(numbers) for numbers in frames],
        positions=np.concatenate([one.positions for one in seen]),
        states=np.concatenate([one.states for one in seen]),
        swapped=np.concatenate([one.swapped for one in seen]),
        angles={name: np.concatenate([truth.angles[name] for truth in truths]) for name in ANGLES},
    )


def _write_skl_form(path: Path, session: Session, rng: np.random.Generator, note: Mapping[str, Any]) -> None:
    def received(frames: int) -> NDArray[np.bool_]:
        mask: NDArray[np.bool_] = rng.random(frames) >= _DROPPED
        mask[0] = True
        return mask

    seen = _record(session, received, rng)
    stamps = 1000.0 * seen.frames / RATE + _CLOCK_JITTER * rng.standard_normal(len(seen.frames))
    milliseconds = _CLOCK_START + _CLOCK_TICK * np.floor(stamps / _CLOCK_TICK).astype(np.int64)
    floor = session.camera.floor_plane
    write_skl(path, milliseconds, seen.positions, seen.states, floor, frame_numbers=seen.frames)
    pass_numbers = np.repeat(np.arange(len(seen.lengths)), seen.lengths)
    note = {**note, "swapped": _indices(seen.swapped)}
    write_truth(truth_path(path), milliseconds / 1000.0, pass_numbers, seen.angles, note)
    write_note(note_path(path), note)


def _write_euler_form(
    path: Path, session: Session, rng: np.random.Generator, note: Mapping[str, Any]
) -> None:
    seen = _record(session, lambda frames: np.ones(frames, dtype=np.bool_), rng)
    # Row of `seen` for every frame of the file: a pass, then its last pose repeated.
    ends = np.cumsum(seen.lengths)
    rows = np.concatenate([
        np.append(np.arange(end - length, end), np.full(_REPEATED_FRAMES if end < ends[-1] else 0, end - 1))
        for end, length in zip(ends, seen.lengths, strict=True)
    ])  # fmt: skip
    away = np.append(False, rows[1:] == rows[:-1])
    gimbal = write_euler_bvh(path, seen.positions, seen.states, rows, frame_time=FRAME_TIME)
    pass_numbers = np.where(away, -1, np.repeat(np.arange(len(seen.lengths)), seen.lengths)[rows])
    angles = {name: np.where(away, np.nan, curve[rows]) for name, curve in seen.angles.items()}
    note = {**note, "gimbal": gimbal, "swapped": _indices(seen.swapped[rows] & ~away)}
    times = FRAME_TIME * np.arange(len(rows), dtype=np.float64)
    write_truth(truth_path(path), times, pass_numbers, angles, note)
    write_note(note_path(path), note)


def _indices(mask: NDArray[np.bool_]) -> list[int]:
    return [int(row) for row in np.flatnonzero(mask)]
