"""Live captures of exercises and gestures, followed with the policy for standing and by the tracker alone.

For each collection: the share of the time in which the humanoid stands, and its falls a minute, while the
person is followed; captures count by their length. The humanoid that has fallen is put back after two
seconds. The first pair of numbers is of `stream` as it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from following import SHARED, follow, steadiness

from kinemimic.evaluate.simulate.session.frame import LiveSettings
from kinemimic.evaluate.simulate.session.live_session import LiveSession
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.live.capture import Moment
from kinemimic.retarget.live.performer import Performed
from kinemimic.train.sim.engines import resolve

COLLECTIONS = {
    "UI-PRMD, Kinect v2": "kinect2_vicon_uiprmd/kinect_*_angles*.txt.gz",
    "UI-PRMD, Vicon": "kinect2_vicon_uiprmd/vicon_*_angles*.txt.gz",
    "KIMORE, Kinect v2": "kinect2_kimore/JointPositionExercise*.csv",
    "MSR-Action3D, Kinect v1": "kinect1_msraction3d/*.txt",
    "gestures, Kinect v2": "kinect2_bernstein_skl/*_*_[0-9]*.skl",
    "squats, Azure Kinect": "../sensors/azure_kinect_vicon/azure_orientations.csv",
    "sitting down, standing up, OpenCap": "../sensors/video_opencap/STS/sample_*.json",
}


def gaits_only(session: LiveSession) -> None:
    """The tracker performs everything, as for somebody who always goes somewhere."""
    perform: Callable[[Moment | None], Performed] = session.performer.perform
    session.performer.perform = lambda moment: replace(perform(moment), on_the_spot=False)  # type: ignore[method-assign]


def main() -> None:
    """Print the table."""
    engine, settings = resolve("auto"), LiveSettings(place=True)
    print(f"{engine}; upright and falls a minute: as it is, and by `tracker` alone")
    rows = []
    for name, pattern in COLLECTIONS.items():
        paths = [path for path in sorted(SHARED.glob(pattern)) if path.name != "SOURCE.txt"]
        found = []
        for path in paths:
            try:
                both = [follow(path, settings, engine, changed) for changed in (None, gaits_only)]
                found.append((len(both[0]), *(steadiness(path, one) for one in both)))
            except KinemimicError as error:
                print(f"left out: {error}")
        if not found:
            print(f"{name:36} left out: no such files; set KINEMIMIC_CAPTURES")
            continue
        rows += found
        print(line(f"{name} ({len(found)})", found), flush=True)
    if rows:
        print(line(f"all ({len(rows)})", rows))


def line(name: str, rows: list[tuple[int, tuple[float, float], tuple[float, float]]]) -> str:
    """Means of captures, by their length."""
    means = np.average([row[1:] for row in rows], axis=0, weights=[row[0] for row in rows])
    return f"{name:40}" + "".join(f"{100 * up:7.0f} % {falls:5.1f}" for up, falls in means)


if __name__ == "__main__":
    main()
