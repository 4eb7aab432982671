"""What PyMoCapViewer's pair of an Azure Kinect and a Vicon shows of the Azure Kinect's knee and hip.

The two files are published as a pair. Whether they are one is measured first: the correlation of both knees'
curves at every shift that leaves at least a third of the shorter recording, for every plausible rate of the
Vicon's file, which states none, and with the sides exchanged. Only knees that correlate would be compared.
What needs no pair is compared in any case: knee and hip by the sensor's recorded orientations against those
by its positions.
Arguments: the folder of the files of other sensors, and the folder for azure.json and azure.png.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.convert import on_nodes
from kinemimic.pipeline.kinematics.angles import ANGLES, leg_angles
from kinemimic.pipeline.kinematics.clip import Clip, forward_kinematics
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.pipeline.readers.recognise import read

DATA_SET = "azure_kinect_vicon"
RATES = (50.0, 60.0, 100.0, 120.0, 200.0)
MIN_OVERLAP = 1.0 / 3.0
# As for the pairs of UI-PRMD (sensor_accuracy.py).
MIN_CORRELATION = 0.9
STEP = 0.02
Curves = dict[str, Array]


def best_alignment(times: Array, seen: Curves, truth: Curves) -> dict[str, Any]:
    """The highest correlation of both knees over rates of the truth (Hz), shifts (s) and exchanged sides.

    times: (T,) s of the curves seen; truth: (S,) a frame each. The shift is added to the times.
    """
    best: dict[str, Any] = {"correlation": -1.0}
    own = times - times[0]
    for rate in RATES:
        frames = len(truth["knee_left"])
        clock = np.arange(frames) / rate
        least = MIN_OVERLAP * min(own[-1], clock[-1])
        for shift in np.arange(least - own[-1], clock[-1] - least, STEP):
            there = (own + shift >= 0.0) & (own + shift <= clock[-1])
            for exchanged in (False, True):
                pairs = []
                for side, other in (("left", "right"), ("right", "left")):
                    a = seen[f"knee_{side}"][there]
                    b = np.interp(own[there] + shift, clock, truth[f"knee_{other if exchanged else side}"])
                    whole = np.isfinite(a) & np.isfinite(b)
                    pairs.append((a[whole] - a[whole].mean(), b[whole] - b[whole].mean()))
                a, b = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
                found = float(a @ b / np.sqrt((a @ a) * (b @ b)))
                if found > best["correlation"]:
                    best = {
                        "correlation": round(found, 3),
                        "rate_hz": rate,
                        "shift_s": round(float(shift), 2),
                        "sides_exchanged": exchanged,
                        "overlap_s": round(float(there.sum() * np.median(np.diff(own))), 1),
                    }
    return best


def by_orientations(clip: Clip) -> Curves:
    """Knees and hips (T,) in radians by the recorded orientations: the angle between shank and thigh, and
    between thigh and pelvis, whose X axes lie along them."""
    assert clip.rotations is not None
    frames = np.zeros((*clip.rotations.shape[:2], 3))
    world = forward_kinematics(clip.skeleton, frames, clip.rotations)[1]
    axis = rotate(world, np.broadcast_to([1.0, 0.0, 0.0], frames.shape))

    def between(a: str, b: str) -> Array:
        cosine = np.sum(axis[:, clip.skeleton.index(a)] * axis[:, clip.skeleton.index(b)], axis=-1)
        return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))

    curves: Curves = {}
    for side in ("left", "right"):
        bend = between(f"HIP_{side.upper()}", f"KNEE_{side.upper()}")
        curves[f"knee_{side}"] = np.minimum(bend, np.pi - bend) if np.median(bend) > 0.5 * np.pi else bend
        hip = between("PELVIS", f"HIP_{side.upper()}")
        # The pelvis' X points up its spine, the right side's frames are mirrored.
        curves[f"hip_{side}"] = hip if np.median(hip) < 0.5 * np.pi else np.pi - hip
    return {name: curves[name] for name in ANGLES}


def tilt(clip: Clip) -> float:
    """Degrees between the camera's vertical and the way of the pelvis, which squats straight down."""
    way = clip.positions[:, clip.skeleton.index("PELVIS")]
    way = way[np.isfinite(way).all(axis=-1)]
    direction = np.linalg.svd(way - way.mean(axis=0), full_matrices=False)[2][0]
    return float(np.degrees(np.arccos(min(1.0, abs(float(direction[2]))))))


def main() -> None:
    """Print and write what is found."""
    sensors, out = (Path(argument) for argument in sys.argv[1:3])
    azure = read(sensors / DATA_SET / "azure_positions.csv")
    vicon = read(sensors / DATA_SET / "vicon.csv")
    seen = leg_angles(on_nodes(azure).positions)
    truth = leg_angles(on_nodes(vicon).positions)
    turned = by_orientations(azure)
    rows = {}
    for joint in ("knee", "hip"):
        off = np.degrees(
            np.concatenate(
                [turned[f"{joint}_{side}"] - seen[f"{joint}_{side}"] for side in ("left", "right")]
            )
        )
        span = [
            np.degrees(np.nanpercentile(np.concatenate([c[f"{joint}_left"], c[f"{joint}_right"]]), [5, 95]))
            for c in (seen, turned, truth)
        ]
        rows[joint] = {
            "rmse_deg": round(float(np.sqrt(np.nanmean(off**2))), 2),
            "bias_deg": round(float(np.nanmean(off)), 2),
            "azure_positions_deg": span[0].round(1).tolist(),
            "azure_orientations_deg": span[1].round(1).tolist(),
            "vicon_deg": span[2].round(1).tolist(),
        }
    best = best_alignment(azure.times, seen, truth)
    report = {
        "alignment": best,
        "one_movement": best["correlation"] >= MIN_CORRELATION,
        "camera_tilt_deg": round(tilt(azure), 1),
        "angles": rows,
    }
    out.mkdir(parents=True, exist_ok=True)
    (out / "azure.json").write_text(json.dumps(report, indent=1) + "\n")
    _draw(azure.times - azure.times[0], seen, turned, truth, out / "azure.png")
    print(json.dumps(report, indent=1))


def _draw(times: Array, seen: Curves, turned: Curves, truth: Curves, path: Path) -> None:
    """Knees of the three, above each other."""
    from matplotlib.figure import Figure  # only a run of the script draws

    figure = Figure(figsize=(14.0, 7.0), layout="constrained")
    panels = figure.subplots(3, 1)
    for panel, curves, title in zip(
        panels, (seen, turned, truth), ("Azure, positions", "Azure, orientations", "Vicon"), strict=True
    ):
        clock = (
            times if len(curves["knee_left"]) == len(times) else np.arange(len(curves["knee_left"])) / 100.0
        )
        for side in ("left", "right"):
            panel.plot(clock, np.degrees(curves[f"knee_{side}"]), label=side)
        panel.set_title(f"{title}: knees, degrees")
    panels[0].legend()
    figure.savefig(path, dpi=60)


if __name__ == "__main__":
    main()
