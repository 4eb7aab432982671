"""How true a Kinect is: its knee and hip against a Vicon's of the same movement, before and after cleaning.

UI-PRMD: Kinect v2 and Vicon, correct executions. The truth is Plug-in-Gait's own angles; the Kinect's are
those of `kinematics/angles.py` from its positions, as read ("before") and after `ingest` with the default
filter and `convert` ("after"). The data set's episodes were cut separately for each sensor, so each pair is
aligned by one shift in time, that at which both knees' curves differ least from the truth, each curve less
its own mean; it is found from the mean of both columns' curves, so that it favours neither.
Arguments: the folder of the captures, and the folder for table.md, accuracy.json and curves.png.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.convert import convert, on_nodes
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.angles import ANGLES, leg_angles
from kinemimic.pipeline.readers.recognise import read

DATA_SET = "kinect2_vicon_uiprmd"
MOVEMENTS = {
    "m01": "deep squat",
    "m02": "hurdle step",
    "m03": "inline lunge",
    "m04": "side lunge",
    "m05": "sit to stand",
    "m07": "shoulder abduction, standing",
}
KNEES = ANGLES[:2]
# Seconds tried as shift. A pair overlaps by this share of its shorter half at least.
SHIFTS = np.arange(-3.0, 3.001, 0.01)
MIN_OVERLAP = 0.8
# Aligned, the knees must correlate this well, or the two files do not show the same repetition.
MIN_CORRELATION = 0.9
# Knees that bend by less (radians) have nothing to align: the episodes are compared from their starts.
STILL = np.radians(15.0)
# A frame is near the peak if the truth is within this of its highest, radians: one noisy frame is no peak.
NEAR_PEAK = np.radians(5.0)
Curves = dict[str, Array]


@dataclass(frozen=True)
class Pair:
    """One recording by both sensors, on the Kinect's clock shifted to the Vicon's.

    times: (T,) seconds of the Vicon; before, after, truth: curves (T,) of ANGLES, radians, NaN where unknown;
    reason: why the pair does not count, else empty.
    """

    name: str
    times: Array
    shift: float
    before: Curves
    after: Curves
    truth: Curves
    reason: str = ""


@dataclass(frozen=True)
class Row:
    """Errors of one movement's knees or hips in degrees, before and after cleaning.

    rmse, bias: over all frames of both legs; peak: mean error near the peak of the leg that bends further;
    step: root mean square of the error's change from frame to frame, which is noise.
    """

    movement: str
    joint: str
    recordings: int
    people: int
    rmse: tuple[float, float]
    bias: tuple[float, float]
    peak: tuple[float, float]
    step: tuple[float, float]


def pairs(captures: Path) -> list[Pair]:
    """Every correct execution that both sensors recorded, in order of name."""
    found = []
    for kinect in sorted((captures / DATA_SET).glob("kinect_*_positions.txt.gz")):
        vicon = kinect.with_name(kinect.name.replace("kinect_", "vicon_"))
        if vicon.is_file():
            found.append(_pair(kinect, vicon))
    return found


def table(found: Iterable[Pair]) -> list[Row]:
    """A row for each movement and joint, of the pairs that count."""
    used = [pair for pair in found if not pair.reason]
    rows = []
    for number, movement in MOVEMENTS.items():
        those = [pair for pair in used if pair.name.startswith(number)]
        people = len({pair.name[4:7] for pair in those})
        for joint in ("knee", "hip"):
            errors = [_errors(those, joint, column) for column in ("before", "after")]
            columns = [tuple(round(error[k], 3) for error in errors) for k in range(4)]
            rows.append(Row(movement, joint, len(those), people, *columns))  # type: ignore[arg-type]
    return rows


def markdown(rows: Iterable[dict[str, Any]]) -> str:
    """The table of results-accuracy.md; rows: as `Row`, in JSON values."""
    head = ["movement (recordings, people)", "angle", "RMSE", "bias", "error at the peak", "change per frame"]
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    for row in rows:
        name = f"{row['movement']} ({row['recordings']}, {row['people']})"
        cells = [_arrow(row["rmse"], 2), *(_arrow(row[key], 1, "+") for key in ("bias", "peak"))]
        lines.append(f"| {name} | {row['joint']} | {' | '.join([*cells, _arrow(row['step'], 2)])} |")
    return "\n".join(lines) + "\n"


def _arrow(both: Iterable[float], digits: int, sign: str = "") -> str:
    return " → ".join(f"{value:{sign}.{digits}f}°".replace("-", "−") for value in both)


def _pair(kinect: Path, vicon: Path) -> Pair:
    name = kinect.name.removeprefix("kinect_").removesuffix("_positions.txt.gz")
    recorded, optical = read(kinect), read(vicon)
    assert optical.angles is not None
    before = leg_angles(on_nodes(recorded).positions)
    with tempfile.TemporaryDirectory() as folder:
        ingest(kinect, Path(folder))
        cleaned = convert(Path(folder))
    # Frames that cleaning drops count in neither column.
    kept = np.isin(recorded.times, cleaned.times)
    before = {key: curve[kept] for key, curve in before.items()}
    after = leg_angles(on_nodes(cleaned).positions)
    # Plug-in-Gait writes zeros where it has no angle.
    known = {key: np.where(curve == 0.0, np.nan, curve) for key, curve in optical.angles.items()}
    reason, shift = "", 0.0
    if max(np.nanmax(known[knee]) - np.nanmin(known[knee]) for knee in KNEES) > STILL:
        both = {knee: 0.5 * (before[knee] + after[knee]) for knee in KNEES}
        correlation, shift = _align(cleaned.times, both, optical.times, known)
        if correlation < MIN_CORRELATION:
            reason = f"the knees of both sensors correlate by {correlation:.2f} at best"
    times = cleaned.times + shift
    truth = {key: _at(times, optical.times, curve) for key, curve in known.items()}
    unknown = np.mean([np.isnan(truth[key]) for key in ANGLES], axis=1).max()
    if not reason and unknown > 0.5:
        reason = f"Plug-in-Gait has no angles of a leg in {100 * unknown:.0f} % of the frames"
    return Pair(name, times, shift, before, after, truth, reason)


def _at(times: Array, clock: Array, curve: Array) -> Array:
    return np.interp(times, clock, curve, left=np.nan, right=np.nan)


def _align(times: Array, seen: Curves, clock: Array, known: Curves) -> tuple[float, float]:
    """The correlation of the knees at the best shift in seconds, and that shift."""
    best = (np.inf, 0.0, 0.0)
    span = min(times[-1] - times[0], clock[-1] - clock[0])
    for shift in SHIFTS:
        moved = times + shift
        if min(moved[-1], clock[-1]) - max(moved[0], clock[0]) < MIN_OVERLAP * span:
            continue
        curves = [(seen[knee], _at(moved, clock, known[knee])) for knee in KNEES]
        whole = [(a[np.isfinite(b)], b[np.isfinite(b)]) for a, b in curves if np.isfinite(b).sum() > 9]
        a, b = (np.concatenate([pair[k] - pair[k].mean() for pair in whole]) for k in (0, 1))
        off = float(np.mean((a - b) ** 2))
        if off < best[0]:
            best = (off, float(a @ b / np.sqrt((a @ a) * (b @ b))), float(shift))
    return best[1], best[2]


def _errors(those: list[Pair], joint: str, column: str) -> tuple[float, float, float, float]:
    """RMSE, bias, error near the peak, and change of the error per frame, degrees."""
    errors, peaks, steps = [], [], []
    for pair in those:
        seen: Curves = getattr(pair, column)
        curves = {side: pair.truth[f"{joint}_{side}"] for side in ("left", "right")}
        off = {side: np.degrees(seen[f"{joint}_{side}"] - truth) for side, truth in curves.items()}
        errors += list(off.values())
        steps += [np.diff(error) for error in off.values()]
        side = max(curves, key=lambda side: float(np.nanmax(curves[side])))
        peaks.append(np.nanmean(off[side][curves[side] > np.nanmax(curves[side]) - NEAR_PEAK]))
    every, changes = np.concatenate(errors), np.concatenate(steps)
    return (
        float(np.sqrt(np.nanmean(every**2))),
        float(np.nanmean(every)),
        float(np.mean(peaks)),
        float(np.sqrt(np.nanmean(changes**2))),
    )


def draw(found: list[Pair], path: Path) -> None:
    """The curves of every pair, aligned: thick the truth, dotted before, thin after cleaning."""
    from matplotlib.figure import Figure  # only a run of the script draws

    figure = Figure(figsize=(16.0, 2.6 * len(found)), layout="constrained")
    axes = figure.subplots(len(found), 2, squeeze=False)
    for row, pair in zip(axes, found, strict=True):
        for panel, joint in zip(row, ("knee", "hip"), strict=True):
            for color, side in (("C0", "left"), ("C1", "right")):
                name = f"{joint}_{side}"
                panel.plot(pair.times, np.degrees(pair.truth[name]), color, lw=5.0, alpha=0.3)
                panel.plot(pair.times, np.degrees(pair.before[name]), color, ls=":", marker=".", ms=3.0)
                panel.plot(pair.times, np.degrees(pair.after[name]), color, lw=1.0)
            reason = f", left out: {pair.reason}" if pair.reason else ""
            panel.set_title(f"{pair.name} {joint}, degrees, shift {pair.shift:+.2f} s{reason}", fontsize=8)
    figure.savefig(path, dpi=60)


def main() -> None:
    """Print the table, and write it and the curves."""
    captures, out = (Path(argument) for argument in sys.argv[1:3])
    found = pairs(captures)
    if not found:
        raise SystemExit(
            f"{captures / DATA_SET}: expected pairs kinect_*_positions.txt.gz and vicon_*, found none"
        )
    rows = [asdict(row) for row in table(found)]
    out.mkdir(parents=True, exist_ok=True)
    (out / "accuracy.json").write_text(json.dumps(rows, indent=1) + "\n")
    (out / "table.md").write_text(markdown(rows))
    draw(found, out / "curves.png")
    print(markdown(rows))
    for pair in found:
        print(
            f"{pair.name}: " + (f"left out: {pair.reason}" if pair.reason else f"shift {pair.shift:+.2f} s")
        )
    print(f"table.md, accuracy.json and curves.png in {out}")


if __name__ == "__main__":
    main()
