"""Live captures of depth sensors, followed with and without denoising.

Walks of Kinects v1 through `stream`, with restarts: a humanoid that has fallen lies for two seconds and is
put back onto its reference. For each: the share of the time in which it stands, and its falls a minute, while
the person is followed. Then walks of the virtual Kinect, whose truth is known: RMSE of knee and hip of the
live reference in degrees. The first number of every pair is denoised.
"""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from against_truth import REPORT_SEEDS
from following import SHARED, follow, steadiness

from kinemimic.evaluate.simulate.session.frame import LiveSettings
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.virtual_kinect.recorder import record_virtual
from kinemimic.train.sim.engines import resolve

# People whom no choice in `train/prediction` was made on.
PEOPLE = range(17, 41, 2)
WALKS = [f"../corpus/kinect1_walks/Person{person:03}_1.txt" for person in PEOPLE]
OTHERS = [
    "kinect1_bernstein_skl/i1.skl",
    "kinect1_bernstein_skl/micha_walk.skl",
    "kinect1_bernstein_skl/pd_1_a.skl",
    "kinect1_bernstein_skl/r2.skl",
    "kinect1_bernstein_skl/tal_l2r.skl",
    "kinect1_treadmill_c3d/skeleton_3d_19h58m42.c3d",
]


def row(path: Path, denoise: bool, engine: str) -> tuple[float, float]:
    """Share of the time upright, and falls a minute."""
    return steadiness(path, follow(path, LiveSettings(place=True, denoise=denoise), engine))


def truth(seed: int, denoise: bool, engine: str) -> tuple[float, float]:
    """RMSE of knee and hip of the live reference against the virtual walker, degrees."""
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        recording = record_virtual(Path(name), motion="walk", seed=seed, sensor="turning")
        ingest(recording.skl, Path(name) / "run")
        table = pq.read_table(Path(name) / "run" / "truth.parquet")
        frames = follow(recording.skl, LiveSettings(place=True, denoise=denoise), engine)
    true = {one: table[one].to_numpy() for one in ("time", *ANGLES)}
    at = np.array([one.shown.time for one in frames if one.shown is not None]) + true["time"][0]
    errors: dict[str, list[Array]] = {"knee": [], "hip": []}
    # The end of a control step performs the newest frame.
    for name in ANGLES:
        curve = np.array([one.wanted[name] for one in frames])
        errors[name.partition("_")[0]].append(curve - np.interp(at, true["time"], true[name]))
    knee, hip = (float(np.degrees(np.sqrt(np.mean(np.square(one))))) for one in errors.values())
    return knee, hip


def main() -> None:
    """Print both tables."""
    engine, both = resolve("auto"), (True, False)
    print(f"tracker that ships, {engine}; upright and falls a minute, denoised and as captured")
    groups: list[tuple[str, list[tuple[float, float]]]] = []
    for name in (*WALKS, *OTHERS):
        path = SHARED / name
        if not path.exists():
            print(f"{path.stem:28} left out: no such file; set KINEMIMIC_CAPTURES")
            continue
        cells = [row(path, one, engine) for one in both]
        groups.append(("walks" if name in WALKS else "others", [*cells]))
        print(
            f"{path.stem:28}" + "".join(f"{100 * up:7.0f} % {falls:5.1f}" for up, falls in cells), flush=True
        )
    for group in ("walks", "others"):
        found = np.array([cells for name, cells in groups if name == group])
        if len(found):
            means = "".join(f"{100 * up:7.0f} % {falls:5.1f}" for up, falls in found.mean(axis=0))
            print(f"{group + ', mean of ' + str(len(found)):28}{means}")
    print("\nRMSE against the virtual Kinect's truth, knee and hip, degrees: denoised and as captured")
    errors = np.array([[truth(seed, one, engine) for one in both] for seed in REPORT_SEEDS])
    for seed, cells in zip(REPORT_SEEDS, errors, strict=True):
        print(f"seed {seed:3}   " + "".join(f"{knee:7.1f} {hip:5.1f}" for knee, hip in cells))
    print("mean       " + "".join(f"{knee:7.1f} {hip:5.1f}" for knee, hip in errors.mean(axis=0)))


if __name__ == "__main__":
    main()
