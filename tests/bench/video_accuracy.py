"""How true a video is: knee and hip of the fitted body against optical capture of the same movement.

Folders with a video (video.mp4) and the body tracks of the same movement as OpenCap publishes them:
sample_mocap.json (optical, the truth), sample_mono.json (OpenCap Monocular), sample_wham.json (WHAM). Knee:
180 degrees less the angle hip, knee, ankle; hip: the angle of the thigh to the line from the middle of the
hips to the middle of the shoulders; femur, tibia, talus and humerus are hip, knee, ankle and shoulder. Root
mean square of the difference over the whole clip, in degrees; every curve is interpolated at the truth's
times. "bare" is the network's own places in metres, low-passed at 6 Hz, without a fit. "retargeted" is the
motion of the humanoid, as recorded and, where the clip has strides, as a loop and as a symmetric one. A last
line says how the error of a frame goes with what the fit makes of its points (`trust`): Spearman's
correlation, which would be -1 if the points that look best were the best.

A shift in time is not taken out, but shown: the one at which the points in the image fit the truth best, each
hip and shoulder by its height; a second table takes it out of every row.
Arguments: the folder of the clips (each a folder), and a folder for table.md.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.signal import butter, filtfilt
from scipy.stats import spearmanr

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.body_fit.body import POINT_INDEX
from kinemimic.pipeline.body_fit.observed import Observed
from kinemimic.pipeline.body_fit.sequence import FittedBody, fit_body
from kinemimic.pipeline.body_fit.settings import FitSettings
from kinemimic.pipeline.convert import convert
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.stages import LANDMARKS_FILE
from kinemimic.pipeline.files.store import file_hash, write_text
from kinemimic.pipeline.files.validation.tables import numbers, read_table
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers.video.recording import observed_of
from kinemimic.pipeline.video.estimate import PoseOptions, landmark_track
from kinemimic.retarget.command import retarget

# Joint: its OpenSim body, and its point in the fitted body.
JOINTS = {
    "hip": ("femur", "hip"),
    "knee": ("tibia", "knee"),
    "ankle": ("talus", "ankle"),
    "shoulder": ("humerus", "shoulder"),
}
SIDES = {"right": "r", "left": "l"}
CUTOFF = 6.0
SHIFTS = np.arange(-0.2, 0.2001, 0.005)
Points = Mapping[str, Array]
"""Joint and side ("knee_left") -> positions (T, 3)."""

SETTINGS: dict[str, FitSettings] = {
    "fitted": FitSettings(),
    "without depth": FitSettings(depth=False),
    "without floor": FitSettings(floor=False),
    "without limits": FitSettings(limits=False),
    "without smoothness": FitSettings(smooth=False),
    "without the image": FitSettings(image=False),
}
# Degrees: fields of view given instead of the assumed one.
VIEWS = (58.0, 62.0, 72.0, 78.0)


def tracks(path: Path) -> tuple[Array, Points]:
    """Times (T,) and joint centres of an OpenSim body track."""
    content = json.loads(path.read_text(encoding="utf-8"))
    bodies = content["bodies"]
    points = {
        f"{joint}_{side}": np.array(bodies[f"{body}_{letter}"]["translation"])
        for joint, (body, _) in JOINTS.items()
        for side, letter in SIDES.items()
    }
    return np.array(content["time"]), points


def joints(points: Array) -> Points:
    """Joint centres out of points (T, P, 3) in the order of the fitted body's."""
    return {
        f"{joint}_{side}": points[:, POINT_INDEX[f"{name}_{side}"]]
        for joint, (_, name) in JOINTS.items()
        for side in SIDES
    }


def bare(observed: Observed) -> Points:
    """Joint centres as the network places them."""
    rate = 1.0 / float(np.median(np.diff(observed.times)))
    smooth = filtfilt(*butter(2, CUTOFF / (rate / 2.0)), observed.world, axis=0)
    return {**joints(smooth), **{f"ankle_{side}": smooth[:, POINT_INDEX[f"instep_{side}"]] for side in SIDES}}


def angles(points: Points) -> dict[str, Array]:
    """Curves (T,) in degrees: knee and hip of both sides."""
    hips, shoulders = (
        (points[f"{joint}_left"] + points[f"{joint}_right"]) / 2.0 for joint in ("hip", "shoulder")
    )
    curves = {}
    for side in SIDES:
        hip, knee, ankle = (points[f"{joint}_{side}"] for joint in ("hip", "knee", "ankle"))
        curves[f"knee_{side}"] = between(knee - hip, ankle - knee)
        curves[f"hip_{side}"] = between(hips - shoulders, knee - hip)
    return curves


def between(first: Array, second: Array) -> Array:
    """Degrees between vectors (T, 3)."""
    product = np.linalg.norm(first, axis=-1) * np.linalg.norm(second, axis=-1)
    return np.degrees(np.arccos(np.clip(np.sum(first * second, axis=-1) / product, -1.0, 1.0)))


def errors(times: Array, points: Points, truth: tuple[Array, Points], shift: float) -> dict[str, float]:
    """RMSE in degrees per angle; shift: seconds by which the truth is later than these times."""
    found, true = angles(points), angles(truth[1])
    inside = (truth[0] - shift >= times[0] - 0.01) & (truth[0] - shift <= times[-1] + 0.02)
    at = truth[0][inside] - shift
    return {
        name: float(np.sqrt(np.mean((np.interp(at, times, found[name]) - curve[inside]) ** 2)))
        for name, curve in true.items()
    }


def shift_of(times: Array, heights: Mapping[str, Array], truth: tuple[Array, Points]) -> float:
    """Seconds by which the truth is later: heights (T,) of hips and shoulders correlate best."""
    total = np.zeros(len(SHIFTS))
    for name, curve in heights.items():
        true = truth[1][name][:, 1]
        inside = (truth[0] > times[0] + 0.2) & (truth[0] < times[-1] - 0.2)
        for k, shift in enumerate(SHIFTS):
            moved = np.interp(truth[0][inside] - shift, times, curve)
            total[k] += np.corrcoef(moved, true[inside])[0, 1]
    return float(SHIFTS[np.argmax(total)])


def row(name: str, found: Mapping[str, float], more: str = "") -> str:
    """A line of the table: right / left, and the means."""
    cells = [f"{found[f'{a}_right']:.1f} / {found[f'{a}_left']:.1f}" for a in ("knee", "hip")]
    means = [f"{(found[f'{a}_right'] + found[f'{a}_left']) / 2.0:.2f}" for a in ("knee", "hip")]
    return f"| {name} | {cells[0]} | **{means[0]}** | {cells[1]} | **{means[1]}** | {more} |\n"


def retargeted(run: Path, **options: bool) -> tuple[Array, Points]:
    """Times (T,) of the video, and joint centres of the humanoid's motion about its root at those times."""
    motion = retarget(run, **options)  # type: ignore[arg-type]
    table, _ = read_table(run / "capture.parquet", kind="the captured angles", advice="")
    times, phase = numbers(table, "time"), numbers(table, "phase")
    inside = np.isfinite(phase)
    places = motion.kinematics()[0] - motion.root[:, None]
    if motion.cyclic:
        phase, places = np.mod(phase, 1.0), np.concatenate([places, places[:1]])
    at = phase[inside] * (len(places) - 1)
    flat = places.reshape(len(places), -1).T
    moved = np.stack([np.interp(at, np.arange(len(places)), column) for column in flat], axis=-1)
    moved = moved.reshape(len(at), -1, 3)
    return times[inside], {
        f"{joint}_{side}": moved[:, NODE_INDEX[f"{joint}_{side}"]] for joint in JOINTS for side in SIDES
    }


def trust(observed: Observed, body: FittedBody) -> Array:
    """(T, P) 0 to 1: visibility, less where the body is off the point in the image, as the fit weighs it."""
    share = 1.0 / (1.0 + (np.nan_to_num(body.misfit, nan=np.inf) / FitSettings().robust) ** 2)
    return observed.certainty * share


def trust_and_error(observed: Observed, truth: tuple[Array, Points], shift: float) -> str:
    """Spearman's correlation of the least trust in an angle's points and the angle's error, per angle."""
    body = fit_body(observed)
    assert body is not None
    weights, found, cells = trust(observed, body), angles(joints(body.points)), []
    for name, true in angles(truth[1]).items():
        joint, side = name.split("_")
        needed = ("hip", "knee", "instep") if joint == "knee" else ("hip", "knee", "shoulder")
        least = weights[:, [POINT_INDEX[f"{one}_{side}"] for one in needed]].min(axis=1)
        error = np.abs(found[name] - np.interp(observed.times + shift, truth[0], true))
        cells.append(f"{name} {spearmanr(least, error).statistic:+.2f}")
    return ", ".join(cells)


def lines(folder: Path, run: Path) -> Iterator[str]:
    """The tables of one clip; run: folder for the results of the stages."""
    video, truth = folder / "video.mp4", tracks(folder / "sample_mocap.json")
    began = time.perf_counter()
    track = landmark_track(video, file_hash(video), PoseOptions(), run / LANDMARKS_FILE)
    seconds = time.perf_counter() - began
    ingest(video, run)
    convert(run)
    observed = observed_of(track)
    heights = {
        f"{joint}_{side}": -observed.pixels[:, POINT_INDEX[f"{joint}_{side}"], 1]
        for joint in ("hip", "shoulder")
        for side in SIDES
    }
    shift = shift_of(track.times, heights, truth)
    others: dict[str, tuple[Array, Points]] = {
        name: tracks(folder / f"sample_{file}.json")
        for name, file in (("OpenCap Monocular", "mono"), ("WHAM", "wham"))
    }
    rows: dict[str, tuple[Array, Points, str]] = {name: (*both, "") for name, both in others.items()}
    rows["network alone"] = (track.times, bare(observed), "")
    for name, settings in SETTINGS.items():
        rows[name] = _fitted(observed, lambda used=settings: fit_body(observed, settings=used))  # type: ignore[misc]
    for view in VIEWS:
        known = replace(FitSettings(), focal_known=True)
        rows[f"--fov {view:g}"] = _fitted(
            observed,
            lambda v=view, used=known: fit_body(observed, field_of_view=np.radians(v), settings=used),  # type: ignore[misc]
        )
    rows["retargeted, as recorded"] = (*retargeted(run, loop=False), "")
    with suppress(KinemimicError):  # no strides
        rows["retargeted, loop"] = (*retargeted(run, loop=True), "")
        rows["retargeted, symmetric loop"] = (*retargeted(run, loop=True, symmetric=True), "")
    frames = len(track.times)
    yield f"\n{folder.name}: {frames} frames, {track.times[-1]:.2f} s; landmarks in {seconds:.1f} s; "
    yield f"the truth is {shift:+.3f} s late\n"
    for title, taken in (("at the given times", 0.0), ("without the shift of the video", shift)):
        yield f"\n| {title} | knee | mean | hip | mean | |\n|---|---|---|---|---|---|\n"
        for name, (times, points, more) in rows.items():
            # The other tracks keep their own clock: their best shift is their own.
            own = taken if name not in others or taken == 0.0 else _best(times, points, truth)
            yield row(name, errors(times, points, truth, own), more)
        if taken == 0.0:
            itself = (truth[0] - shift, truth[1])
            yield row("the truth itself, shifted so", errors(*itself, truth, 0.0))
    yield f"\ntrust and error, Spearman's correlation: {trust_and_error(observed, truth, shift)}\n"


def _fitted(observed: Observed, fit: Callable[[], object]) -> tuple[Array, Points, str]:
    began = time.process_time()
    body = fit()
    seconds = time.process_time() - began
    view = np.degrees(2.0 * np.arctan(max(observed.size) / 2.0 / body.scene.camera.focal))  # type: ignore[attr-defined]
    more = f"{body.steps} steps, {seconds:.1f} s of CPU, field of view {view:.0f}°"  # type: ignore[attr-defined]
    return observed.times, joints(body.points), more  # type: ignore[attr-defined]


def _best(times: Array, points: Points, truth: tuple[Array, Points]) -> float:
    heights = {f"{a}_{side}": points[f"{a}_{side}"][:, 1] for a in ("hip", "shoulder") for side in SIDES}
    return shift_of(times, heights, truth)


def main() -> None:
    clips, out = Path(sys.argv[1]), Path(sys.argv[2])
    found = "".join(
        line
        for folder in sorted(clips.iterdir())
        if (folder / "video.mp4").is_file() and (folder / "sample_mocap.json").is_file()
        for line in lines(folder, out / folder.name)
    )
    if not found:
        sys.exit(f"{clips}: expected folders with video.mp4 and sample_mocap.json, found none")
    write_text(out / "table.md", found)
    print(found, end="")


if __name__ == "__main__":
    main()
