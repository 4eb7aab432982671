"""Every filter against the truth that the virtual Kinect knows: knee, hip and lag, and after retarget.

Walk and run, several seeds and levels of noise, both forms of the recording. The best is the default of
`kinemimic ingest`; `none` is the recording as read, its gaps filled. The seeds are not those on which the
filters' constants were chosen (100 to 103).
"""

from __future__ import annotations

import itertools
import multiprocessing
import os
import sys
import tempfile
import warnings
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.convert import on_nodes
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.filters.clean import clean
from kinemimic.pipeline.filters.options import FILTERS
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.readers.recognise import read
from kinemimic.pipeline.virtual_kinect.noise import NoiseLevels
from kinemimic.pipeline.virtual_kinect.recorder import record_virtual
from kinemimic.retarget.captured_angles import PassSpan, captured_angles
from kinemimic.retarget.cyclic import fit_cyclic
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.retarget.optimise.refine import refine
from kinemimic.retarget.strides.loop import pool_strides
from kinemimic.retarget.strides.passes import Pass, analyze_passes, select_passes
from kinemimic.retarget.strides.sensor_reliability import assess_reliability
from kinemimic.train.reference.reference import Reference

SEEDS = 20
LEVELS = (0.5, 1.0, 2.0)  # of the white noise, in that of real Kinect v1 walks
MOTIONS = ("walk", "run")
FORMS = ("skl", "euler")
SHIFTS = np.arange(-0.2, 0.2001, 0.01)  # seconds tried as lag
JOINTS = ("knee", "hip")


class Recorded(NamedTuple):
    """One recording to make and to clean in every way."""

    motion: str
    white: float
    seed: int


class Row(NamedTuple):
    """One recording cleaned by one filter.

    whole, used, loop: degrees rms of knee and hip over whole passes, over the strides that retarget used, and
    of its loop; lag: seconds; passes: how many were used, of how many.
    """

    whole: tuple[float, float]
    used: tuple[float, float]
    loop: tuple[float, float]
    lag: float
    passes: int
    of: int


def measure(task: Recorded) -> dict[tuple[str, str], Row]:
    """Rows by form and filter."""
    rows: dict[tuple[str, str], Row] = {}
    with tempfile.TemporaryDirectory() as folder:
        levels = NoiseLevels(white=task.white)
        recording = record_virtual(Path(folder), motion=task.motion, seed=task.seed, levels=levels)
        for form, path in zip(FORMS, recording, strict=True):
            raw = check_capture(read(path)).clip
            table = pq.read_table(path.with_suffix(".truth.parquet"))
            truth = {name: table[name].to_numpy() for name in ("time", *ANGLES)}
            for method in FILTERS:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    rows[form, method] = compare(raw, clean(raw, method)[0], truth)
    return rows


def compare(raw: Clip, cleaned: Clip, truth: dict[str, Array]) -> Row:
    """One cleaned clip against the truth."""
    clip, recorded = on_nodes(cleaned), on_nodes(raw)
    passes = analyze_passes(clip)
    reliability = assess_reliability(pool_strides(clip, [one for one in passes if one.harmonic is not None]))
    spans = [_span(clip, one, np.flatnonzero(clip.passes == one.number)) for one in passes]
    whole = captured_angles(clip, recorded, spans, reliability, truth)
    nothing = (np.nan, np.nan)
    row = Row(_errors(whole, "clean_"), nothing, nothing, _lag(whole), 0, len(passes))
    try:
        chosen, _ = select_passes(passes)
        fit = fit_cyclic(clip, chosen)
    except KinemimicError:
        return row
    used = captured_angles(
        clip, recorded, [_span(clip, one, one.frames) for one in chosen], fit.reliability, truth
    )
    loop = joint_angles(Reference(refine(fit.motion)).nodes(used["phase"]))
    used |= {f"loop_{name}": loop[name] for name in ANGLES}
    return row._replace(used=_errors(used, "clean_"), loop=_errors(used, "loop_"), passes=len(chosen))


def _span(clip: Clip, one: Pass, frames: NDArray[np.intp]) -> PassSpan:
    first, last = clip.times[frames[[0, -1]]]
    start, period = (one.harmonic.start, one.harmonic.period) if one.harmonic else (0.0, 1.0)
    clock = (clip.times[one.frames], one.clock) if one.individually_timed else None
    return PassSpan(one.number, float(first), float(last), one.heading, start, period, clock)


def _errors(columns: dict[str, Array], prefix: str) -> tuple[float, float]:
    """Root mean square over both sides, degrees: knee, hip."""
    knee, hip = (
        np.concatenate([columns[f"{prefix}{j}_{s}"] - columns[f"truth_{j}_{s}"] for s in ("left", "right")])
        for j in JOINTS
    )
    return float(np.degrees(np.sqrt(np.nanmean(knee**2)))), float(np.degrees(np.sqrt(np.nanmean(hip**2))))


def _lag(columns: dict[str, Array]) -> float:
    """Seconds by which the knees come late: where their correlation with the truth, shifted, is greatest."""
    found = []
    for shift in SHIFTS:
        pairs = []
        for number, name in itertools.product(np.unique(columns["pass"]), ANGLES[:2]):
            frames = columns["pass"] == number
            t = columns["time"][frames]
            inner = (t > t[0] + SHIFTS[-1]) & (t < t[-1] - SHIFTS[-1])
            late = np.interp(t[inner] - shift, t, columns[f"truth_{name}"][frames])
            pairs.append(np.stack([columns[f"clean_{name}"][frames][inner], late]))
        both = np.concatenate(pairs, axis=1)
        found.append(np.corrcoef(both[:, np.isfinite(both).all(axis=0)])[0, 1])
    k = int(np.clip(np.argmax(found), 1, len(found) - 2))
    low, middle, high = found[k - 1 : k + 2]
    return float(SHIFTS[k] + 0.5 * (SHIFTS[1] - SHIFTS[0]) * (low - high) / (low - 2.0 * middle + high))


def main() -> None:
    """Print one table; arguments, for a shorter run: how many seeds, and the first of them."""
    count, first = (int(text) for text in (sys.argv[1:] + [str(SEEDS), "0"][len(sys.argv) - 1 :])[:2])
    tasks = [
        Recorded(motion, white, seed)
        for motion, white, seed in itertools.product(MOTIONS, LEVELS, range(first, first + count))
    ]
    os.environ["OMP_NUM_THREADS"] = "1"  # of the workers, which load numpy afresh
    with ProcessPoolExecutor(max_workers=2, mp_context=multiprocessing.get_context("spawn")) as pool:
        results = dict(zip(tasks, pool.map(measure, tasks), strict=True))
    print(f"{count} seeds; RMSE against the truth in degrees, knee and hip; lag of the knee in ms")
    print(f"{'':31}whole passes   strides used   after retarget    lag   passes")
    for motion, white, form, method in itertools.product(MOTIONS, LEVELS, FORMS, FILTERS):
        rows = [results[task][form, method] for task in tasks if (task.motion, task.white) == (motion, white)]
        print(f"{motion:4}  noise x{white:3}  {form:5}  {method:11}" + _cells(rows))


def _cells(rows: list[Row]) -> str:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # mean of nothing, where retarget took none
        means = [
            np.nanmean([getattr(row, name) for row in rows], axis=0) for name in ("whole", "used", "loop")
        ]
    cells = "".join(f"   {knee:5.2f}  {hip:5.2f}" for knee, hip in means)
    lag = 1e3 * np.mean([row.lag for row in rows])
    return f"{cells}   {lag:+6.1f}   {sum(r.passes for r in rows)}/{sum(r.of for r in rows)}"


if __name__ == "__main__":
    main()
