"""Recordings of the virtual Kinect through the stages, against the truth: what the bench scripts share.

Seeds are split by use, so that nothing is reported on what it was chosen on. Seed 0 is the one that `run`
records and that the data set ships.
"""

from __future__ import annotations

import itertools
import multiprocessing
import os
import tempfile
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
import pyarrow.parquet as pq

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.convert import convert
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.angles import ANGLES, leg_angles
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.virtual_kinect.noise import NoiseLevels
from kinemimic.pipeline.virtual_kinect.recorder import record_virtual
from kinemimic.retarget.command import retarget
from kinemimic.retarget.formats.gait_json import read_gait_json
from kinemimic.retarget.gate import check_report
from kinemimic.retarget.humanoid.motion import angles_at

REPORT_SEEDS = range(10)
# Defaults are chosen on these, e.g. that of `ingest --filter`.
SELECTION_SEEDS = range(200, 212)
FORMS = ("skl", "euler")
JOINTS = ("knee", "hip")
SHIFTS = np.arange(-0.2, 0.2001, 0.01)  # seconds tried as lag
NOTHING = (np.nan, np.nan)
PHASES = 50
T, R = TypeVar("T"), TypeVar("R")


class Recorded(NamedTuple):
    """One recording to make: as for `record_virtual`; white: factor on the sensor's white noise."""

    motion: str = "walk"
    seed: int = 0
    speed: float | None = None
    variability: float = 1.0
    sensor: str = "fixed"
    white: float = 1.0


class Row(NamedTuple):
    """One recording in one form, cleaned by one filter: degrees rms of knee and hip.

    whole: cleaned, of whole passes; raw, cleaned, loop: over the strides that retarget used, as recorded,
    cleaned, and of its loop. NaN if there is no motion. spread: of the truth about its own mean over the true
    phase, which no loop can show. trainable: whether `train` accepts the motion. lag: seconds by which the
    cleaned knees come late.
    """

    whole: tuple[float, float]
    raw: tuple[float, float] = NOTHING
    cleaned: tuple[float, float] = NOTHING
    loop: tuple[float, float] = NOTHING
    spread: tuple[float, float] = NOTHING
    trainable: bool = False
    lag: float = np.nan


def measure(
    task: Recorded, filters: Sequence[str | None] = (None,), forms: Sequence[str] = FORMS
) -> dict[tuple[str, str | None], Row]:
    """Rows by form and filter; None is the default filter."""
    rows: dict[tuple[str, str | None], Row] = {}
    os.environ["OMP_NUM_THREADS"] = "1"
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        folder = Path(name)
        recording = record_virtual(
            folder,
            motion=task.motion,
            seed=task.seed,
            speed=task.speed,
            variability=task.variability,
            sensor=task.sensor,
            levels=NoiseLevels(white=task.white),
        )
        for form, method in itertools.product(forms, filters):
            rows[form, method] = _row(getattr(recording, form), folder / f"{form}-{method}", method)
    return rows


def _row(capture: Path, run: Path, method: str | None) -> Row:
    clip = ingest(capture, run, filter_name=method)
    table = pq.read_table(run / "truth.parquet")
    truth = {name: table[name].to_numpy() for name in ("time", "pass", "stride", *ANGLES)}
    seen = leg_angles(to_nodes(clip)[0])
    kept = clip.passes >= 0
    shown = {name: np.interp(clip.times, truth["time"], truth[name])[kept] for name in ANGLES}
    whole = {name: seen[name][kept] for name in ANGLES}
    row = Row(
        _rms(whole, shown), spread=_spread(truth), lag=_lag(clip.times[kept], clip.passes[kept], whole, shown)
    )
    try:
        convert(run)
        motion = retarget(run)
    except KinemimicError:
        return row
    findings = check_report(read_gait_json(run / "gait.json"))
    used = pq.read_table(run / "capture.parquet")
    used = used.filter(used["used"])
    columns = {name: used[name].to_numpy() for name in used.column_names}
    true = {name: columns[f"truth_{name}"] for name in ANGLES}
    return row._replace(
        raw=_rms(columns, true),
        cleaned=_rms({name: columns[f"clean_{name}"] for name in ANGLES}, true),
        loop=_rms(angles_at(motion, columns["phase"]), true),
        trainable=not any(finding.severity == "refuse" for finding in findings),
    )


def _spread(truth: dict[str, Array]) -> tuple[float, float]:
    """Degrees rms of knee and hip about their mean over the true stride, joined between PHASES."""
    walked = truth["pass"] >= 0
    phase = np.mod(truth["stride"][walked], 1.0)
    near = np.rint(phase * PHASES).astype(int) % PHASES
    count = np.maximum(np.bincount(near, minlength=PHASES), 1)
    knots = np.arange(PHASES) / PHASES
    curves = {name: truth[name][walked] for name in ANGLES}
    means = {
        name: np.interp(phase, knots, np.bincount(near, curve, minlength=PHASES) / count, period=1.0)
        for name, curve in curves.items()
    }
    return _rms(curves, means)


def _rms(curves: dict[str, Array], truth: dict[str, Array]) -> tuple[float, float]:
    """Root mean square over both sides, degrees: knee, hip."""
    knee, hip = (
        np.concatenate([curves[f"{joint}_{side}"] - truth[f"{joint}_{side}"] for side in ("left", "right")])
        for joint in JOINTS
    )
    return float(np.degrees(np.sqrt(np.nanmean(knee**2)))), float(np.degrees(np.sqrt(np.nanmean(hip**2))))


def _lag(times: Array, passes: Array, seen: dict[str, Array], truth: dict[str, Array]) -> float:
    """Seconds by which the knees come late: where their correlation with the truth, shifted, is greatest."""
    found = []
    for shift in SHIFTS:
        pairs = []
        for number, name in itertools.product(np.unique(passes), ANGLES[:2]):
            frames = passes == number
            t = times[frames]
            inner = (t > t[0] + SHIFTS[-1]) & (t < t[-1] - SHIFTS[-1])
            late = np.interp(t[inner] - shift, t, truth[name][frames])
            pairs.append(np.stack([seen[name][frames][inner], late]))
        both = np.concatenate(pairs, axis=1)
        found.append(np.corrcoef(both[:, np.isfinite(both).all(axis=0)])[0, 1])
    k = int(np.clip(np.argmax(found), 1, len(found) - 2))
    low, middle, high = found[k - 1 : k + 2]
    return float(SHIFTS[k] + 0.5 * (SHIFTS[1] - SHIFTS[0]) * (low - high) / (low - 2.0 * middle + high))


def on_all_cores(work: Callable[[T], R], tasks: Sequence[T]) -> list[R]:
    """work(task) of every task, in processes that load numpy with one thread each."""
    os.environ["OMP_NUM_THREADS"] = "1"
    with ProcessPoolExecutor(mp_context=multiprocessing.get_context("spawn")) as pool:
        return list(pool.map(work, tasks))


def mean(rows: Sequence[Row], name: str) -> tuple[float, float]:
    """Knee and hip of one column, means over the recordings that have it; NaN if none has."""
    values = np.array([getattr(row, name) for row in rows])
    known = values[np.isfinite(values).all(axis=1)]
    return (float(known[:, 0].mean()), float(known[:, 1].mean())) if len(known) else NOTHING
