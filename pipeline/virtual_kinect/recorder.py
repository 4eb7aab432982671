"""The virtual Kinect's recorder: a person who walks as a Kinect v1 would record it, with the truth.

The person makes several passes before a simulated sensor, oblique to its line of sight, or walks half circles
round one that turns. Each recording is written in two forms: the v1 recorder's `.skl` text, and BVH with the
Euler angles of Eq. 8. Next to each are NAME.truth.parquet and NAME.provenance.json, which marks it as
simulated.
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
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion
from kinemimic.pipeline.virtual_kinect.euler_bvh import write_euler_bvh
from kinemimic.pipeline.virtual_kinect.noise import NoiseLevels, Observation
from kinemimic.pipeline.virtual_kinect.placement import PLACEMENTS, Placement, see
from kinemimic.pipeline.virtual_kinect.subject import Gait, GroundTruth, close_loop
from kinemimic.pipeline.virtual_kinect.variability import Variability
from kinemimic.pipeline.virtual_kinect.walker import person, walk
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
# Radius of the half circles round a sensor that turns, metres.
RADIUS = 2.7
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
    """One walk past the sensor: start_time (s), start (2,), heading (rad), turn (rad/s), phase (cycles) and
    frames."""

    start_time: float
    start: Array
    heading: float
    turn: float
    phase: float
    frames: int


@dataclass(frozen=True)
class Session:
    """All that both forms of a recording share."""

    passes: list[Pass]
    truths: list[GroundTruth]  # of every frame of each pass
    placement: Placement
    levels: NoiseLevels


@dataclass(frozen=True)
class Recorded:
    """All passes joined: frames: (N,) numbers of the sensor's frames; lengths: frames of each pass; positions
    (N, 20, 3), states (N, 20), swapped (N,): as in Observation; truth: the true columns (N,) by name."""

    frames: NDArray[np.int64]
    lengths: list[int]
    positions: Array
    states: States
    swapped: Mask
    truth: dict[str, Array]


def record_virtual(
    folder: Path,
    *,
    motion: str = "walk",
    seed: int = 0,
    speed: float | None = None,
    variability: float = 1.0,
    sensor: str = "fixed",
    levels: NoiseLevels | None = None,
) -> Recording:
    """Record a stock motion of the pybullet wheel: `kinect_<motion>.skl` and `kinect_<motion>_euler.bvh`;
    the names of other sensors than the fixed one have the sensor after the motion.

    speed: m/s, None for the stock motion's; variability: factor on what was measured on people, 0 for one
    exact cycle; sensor: a key of PLACEMENTS. The same seed gives the same bytes. The two forms show the same
    passes with independent noise.
    """
    placement, levels = PLACEMENTS[sensor], levels or NoiseLevels()
    varying = Variability.measured(variability)
    source = stock_motion(motion)
    gait = person(close_loop(read_deepmimic(source)), varying, np.random.default_rng([seed, 3]), speed)
    passes = plan_passes(gait, np.random.default_rng([seed, 0]), turning=placement.turns)
    truths = [
        walk(
            gait,
            np.arange(one.frames) / RATE,
            start=one.start,
            heading=one.heading,
            phase=one.phase,
            turn=one.turn,
            levels=varying,
            rng=np.random.default_rng([seed, 4, number]),
        )
        for number, one in enumerate(passes)
    ]
    config = {
        "speed": speed,
        "variability": asdict(varying),
        "sensor": sensor,
        "placement": asdict(placement),
        "levels": asdict(levels),
        "rate": RATE,
        "passes": len(passes),
    }
    made = provenance("virtual", inputs={source.name: file_hash(source)}, config=config, seed=seed)
    note = {
        "simulated": True,
        "sensor": "virtual Kinect v1",
        "motion": motion,
        "virtual_kinect": {**made, **_walked(truths)},
    }
    name = f"kinect_{motion}" if sensor == "fixed" else f"kinect_{motion}_{sensor}"
    skl, euler = folder / f"{name}.skl", folder / f"{name}_euler.bvh"
    session = Session(passes, truths, placement, levels)
    _write_skl_form(skl, session, np.random.default_rng([seed, 1]), note)
    _write_euler_form(euler, session, np.random.default_rng([seed, 2]), note)
    return Recording(skl, euler)


def plan_passes(gait: Gait, rng: np.random.Generator, *, turning: bool = False) -> list[Pass]:
    """The passes over PATHS, or there and back on a half circle round a sensor that turns, each starting at a
    random phase, with absences in between."""
    passes: list[Pass] = []
    clock = total = 0.0
    while total < MIN_DURATION:
        for start, heading, turn, length in _circles(gait.speed) if turning else _lines():
            duration = length / gait.speed
            frames = int(duration * RATE) + 1
            passes.append(Pass(clock, start, heading, turn, float(rng.random()), frames))
            clock += duration + float(rng.uniform(*_ABSENCE))
            total += duration
    return passes


def _lines() -> list[tuple[Array, float, float, float]]:
    """Start, heading, turn (rad/s) and length (m) of each of PATHS."""
    paths = np.array(PATHS)
    return [
        (start, float(np.arctan2(*(end - start)[::-1])), 0.0, float(np.hypot(*(end - start))))
        for start, end in paths
    ]


def _circles(speed: float) -> list[tuple[Array, float, float, float]]:
    """The same of half circles about the sensor, to the left and back."""
    return [
        (np.array([0.0, -side * RADIUS]), 0.0, side * speed / RADIUS, np.pi * RADIUS) for side in (1.0, -1.0)
    ]


def _walked(truths: list[GroundTruth]) -> dict[str, float]:
    """Speed (m/s) and period (s), means over the whole strides of all passes; from end to end of shorter
    passes."""
    strides = seconds = metres = 0.0
    for truth in truths:
        elapsed = np.arange(len(truth.phase)) / RATE
        last = max(float(np.floor(truth.phase[-1] - truth.phase[0])), 0.0)
        ends = truth.phase[0] + np.arange(last + 1) if last else truth.phase[[0, -1]]
        times = np.interp(ends, truth.phase, elapsed)
        hips = truth.joints[:, NODE_INDEX["hip_center"], :2]
        places = np.stack([np.interp(times, elapsed, hips[:, axis]) for axis in (0, 1)], axis=-1)
        strides += float(ends[-1] - ends[0])
        seconds += float(times[-1] - times[0])
        metres += float(np.linalg.norm(np.diff(places, axis=0), axis=-1).sum())
    return {"speed": round(metres / seconds, 6), "period": round(seconds / strides, 6)}


def _record(
    session: Session, received: Callable[[int], NDArray[np.bool_]], rng: np.random.Generator
) -> Recorded:
    """The passes as recorded; received: number of frames of a pass -> which the recorder did not drop."""
    frames: list[NDArray[np.int64]] = []
    truths: list[dict[str, Array]] = []
    seen: list[Observation] = []
    for one, whole in zip(session.passes, session.truths, strict=True):
        numbers = np.flatnonzero(received(one.frames))
        truth = whole.at(numbers)
        frames.append((numbers + round(one.start_time * RATE)).astype(np.int64))
        truths.append(truth.columns)
        seen.append(see(truth, numbers / RATE, session.placement, session.levels, rng))
    return Recorded(
        frames=np.concatenate(frames),
        lengths=[len(numbers) for numbers in frames],
        positions=np.concatenate([one.positions for one in seen]),
        states=np.concatenate([one.states for one in seen]),
        swapped=np.concatenate([one.swapped for one in seen]),
        truth={name: np.concatenate([columns[name] for columns in truths]) for name in truths[0]},
    )


def _write_skl_form(path: Path, session: Session, rng: np.random.Generator, note: Mapping[str, Any]) -> None:
    def received(frames: int) -> NDArray[np.bool_]:
        mask: NDArray[np.bool_] = rng.random(frames) >= _DROPPED
        mask[0] = True
        return mask

    seen = _record(session, received, rng)
    stamps = 1000.0 * seen.frames / RATE + _CLOCK_JITTER * rng.standard_normal(len(seen.frames))
    milliseconds = _CLOCK_START + _CLOCK_TICK * np.floor(stamps / _CLOCK_TICK).astype(np.int64)
    floor = session.placement.floor_plane
    write_skl(path, milliseconds, seen.positions, seen.states, floor, frame_numbers=seen.frames)
    pass_numbers = np.repeat(np.arange(len(seen.lengths)), seen.lengths)
    note = {**note, "swapped": _indices(seen.swapped)}
    write_truth(truth_path(path), milliseconds / 1000.0, pass_numbers, seen.truth, note)
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
    truth = {name: np.where(away, np.nan, curve[rows]) for name, curve in seen.truth.items()}
    note = {**note, "gimbal": gimbal, "swapped": _indices(seen.swapped[rows] & ~away)}
    times = FRAME_TIME * np.arange(len(rows), dtype=np.float64)
    write_truth(truth_path(path), times, pass_numbers, truth, note)
    write_note(note_path(path), note)


def _indices(mask: NDArray[np.bool_]) -> list[int]:
    return [int(row) for row in np.flatnonzero(mask)]
