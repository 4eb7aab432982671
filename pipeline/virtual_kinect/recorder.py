"""The virtual Kinect: a person's optical capture, recorded again as a Kinect v1 would, and the truth of it.

The stock walk (or run) is performed in several passes before a simulated sensor, oblique to its line of
sight, and written in two forms: the v1 recorder's `.skl` text, and BVH with the Euler angles of Eq. 8. Beside
each stand NAME.truth.parquet and NAME.provenance.json, which says that it is simulated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.provenance import provenance
from kinemimic.pipeline.files.sidecars import note_path, truth_path, write_note, write_truth
from kinemimic.pipeline.files.store import file_hash
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.readers.mocap.deepmimic import read_deepmimic, stock_motion
from kinemimic.pipeline.virtual_kinect.camera import Camera
from kinemimic.pipeline.virtual_kinect.euler_bvh import euler_form
from kinemimic.pipeline.virtual_kinect.noise import Levels, Observation, observe
from kinemimic.pipeline.virtual_kinect.subject import Gait, Performance, close_loop, perform
from kinemimic.pipeline.writers.skl import write_skl

RATE = 30.0
# As a BVH states it; the truth of that form is on this clock.
FRAME_TIME = 0.03333333
# Start and end of the passes on the floor: metres before the sensor, metres to its left. All of them come
# nearer, from frontal to almost sideways, within what the sensor sees (4.2 m to about 1.7 m).
PATHS: tuple[tuple[tuple[float, float], tuple[float, float]], ...] = (
    ((4.1, 1.7), (2.1, -0.9)),
    ((4.1, -1.7), (2.1, 0.9)),
    ((4.2, 0.9), (1.7, -0.3)),
    ((4.2, -0.9), (1.7, 0.3)),
    ((3.5, 1.6), (2.5, -1.2)),
    ((3.5, -1.6), (2.5, 1.2)),
)
# The round of passes is repeated until so much motion is recorded: runners cross the view in a second.
ENOUGH = 15.0
# The recorder's clock ticks every 4 ms, so that 30 Hz show as steps of 32 and 36 ms; some frames are dropped.
_CLOCK_TICK = 4
_CLOCK_JITTER = 1.0
_CLOCK_START = 1_000_000
_DROPPED = 0.015
_ABSENCE = (3.0, 7.0)
# Frames for which a recorder without a clock repeats the last pose while nobody is there: 0.7 s.
_REPEATED = 21


class Recording(NamedTuple):
    """The two forms of a recording: text of the v1 recorder, and BVH with Euler angles."""

    skl: Path
    euler: Path


@dataclass(frozen=True)
class Pass:
    """One walk past the sensor: when it begins (s), where (2,), its heading (rad), phase (cycles), frames."""

    begins: float
    start: Array
    heading: float
    phase: float
    frames: int


@dataclass(frozen=True)
class Seen:
    """One pass as recorded: frames (n,) of the sensor, the truth then, and what the sensor made of it."""

    frames: NDArray[np.int64]
    truth: Performance
    observation: Observation


def record_virtual(
    folder: Path,
    *,
    motion: str = "walk",
    seed: int = 0,
    camera: Camera | None = None,
    levels: Levels | None = None,
) -> Recording:
    """Record a stock motion of the pybullet wheel: `kinect_<motion>.skl` and `kinect_<motion>_euler.bvh`.

    The same seed gives the same bytes. The two forms show the same passes with noise of their own.
    """
    camera, levels = camera or Camera(), levels or Levels()
    source = stock_motion(motion)
    gait = close_loop(read_deepmimic(source))
    passes = plan(gait, np.random.default_rng([seed, 0]))
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
    _write_skl_form(skl, gait, passes, camera, levels, np.random.default_rng([seed, 1]), note)
    _write_euler_form(euler, gait, passes, camera, levels, np.random.default_rng([seed, 2]), note)
    return Recording(skl, euler)


def plan(gait: Gait, rng: np.random.Generator) -> list[Pass]:
    """The passes over PATHS, each starting at a phase of its own, with the subject away in between."""
    passes: list[Pass] = []
    clock = walked = 0.0
    while walked < ENOUGH:
        for start, end in np.array(PATHS):
            way = end - start
            duration = float(np.hypot(*way)) / gait.speed
            heading = float(np.arctan2(way[1], way[0]))
            frames = int(duration * RATE) + 1
            passes.append(Pass(clock, start, heading, float(rng.random()), frames))
            clock += duration + float(rng.uniform(*_ABSENCE))
            walked += duration
    return passes


def see(
    gait: Gait, walk: Pass, kept: NDArray[np.bool_], camera: Camera, levels: Levels, rng: np.random.Generator
) -> Seen:
    """One pass through the sensor; kept: (frames,) False where the recorder dropped the frame."""
    number = np.flatnonzero(kept)
    elapsed = number / RATE
    truth = perform(gait, elapsed, start=walk.start, heading=walk.heading, phase=walk.phase)
    frames = (number + round(walk.begins * RATE)).astype(np.int64)
    return Seen(frames, truth, observe(truth.joints, truth.heading, elapsed, camera, levels, rng))


def _write_skl_form(
    path: Path,
    gait: Gait,
    passes: list[Pass],
    camera: Camera,
    levels: Levels,
    rng: np.random.Generator,
    note: Mapping[str, Any],
) -> None:
    seen: list[Seen] = []
    for walk in passes:
        kept = rng.random(walk.frames) >= _DROPPED
        kept[0] = True
        seen.append(see(gait, walk, kept, camera, levels, rng))
    frames = np.concatenate([one.frames for one in seen])
    stamps = 1000.0 * frames / RATE + _CLOCK_JITTER * rng.standard_normal(len(frames))
    milliseconds = _CLOCK_START + _CLOCK_TICK * np.floor(stamps / _CLOCK_TICK).astype(np.int64)
    write_skl(
        path,
        milliseconds,
        np.concatenate([one.observation.positions for one in seen]),
        np.concatenate([one.observation.states for one in seen]),
        camera.floor_plane,
        frame_numbers=frames,
    )
    swapped = np.concatenate([one.observation.swapped for one in seen])
    number = np.repeat(np.arange(len(seen)), [len(one.frames) for one in seen])
    angles = {name: np.concatenate([one.truth.angles[name] for one in seen]) for name in ANGLES}
    note = {**note, "swapped": _rows(swapped)}
    write_truth(truth_path(path), milliseconds / 1000.0, number, angles, note)
    write_note(note_path(path), note)


def _write_euler_form(
    path: Path,
    gait: Gait,
    passes: list[Pass],
    camera: Camera,
    levels: Levels,
    rng: np.random.Generator,
    note: Mapping[str, Any],
) -> None:
    seen = [see(gait, walk, np.ones(walk.frames, dtype=np.bool_), camera, levels, rng) for walk in passes]
    lengths = [len(one.frames) for one in seen]
    # Row of `seen` for every frame of the file: a pass, then its last pose again and again.
    ends = np.cumsum(lengths)
    rows = np.concatenate([
        np.append(np.arange(end - length, end), np.full(_REPEATED if end < ends[-1] else 0, end - 1))
        for end, length in zip(ends, lengths, strict=True)
    ])  # fmt: skip
    away = np.append(False, rows[1:] == rows[:-1])
    gimbal = euler_form(
        path,
        np.concatenate([one.observation.positions for one in seen]),
        np.concatenate([one.observation.states for one in seen]),
        rows,
        frame_time=FRAME_TIME,
    )
    swapped = np.concatenate([one.observation.swapped for one in seen])[rows] & ~away
    number = np.where(away, -1, np.repeat(np.arange(len(seen)), lengths)[rows])
    angles = {
        name: np.where(away, np.nan, np.concatenate([one.truth.angles[name] for one in seen])[rows])
        for name in ANGLES
    }
    note = {**note, "gimbal": gimbal, "swapped": _rows(swapped)}
    write_truth(truth_path(path), FRAME_TIME * np.arange(len(rows), dtype=np.float64), number, angles, note)
    write_note(note_path(path), note)


def _rows(mask: NDArray[np.bool_]) -> list[int]:
    return [int(row) for row in np.flatnonzero(mask)]
