"""KinectReader CSV: ticks of 100 ns, then 25 x (x, y, z, state), a comma at the end."""

from __future__ import annotations

from samples.kimore import SENSOR
from samples.motion import in_sight, kinect_v2_joints, walk, y_up

FIRST_TICK = 31_867_373_716


def files(frames: int = 90) -> dict[str, bytes]:
    """A take whose lower legs are inferred, as those of a person behind a table."""
    shown = in_sight(walk(frames))
    rows = []
    for time, frame in zip(shown.times, y_up(kinect_v2_joints(shown)) + SENSOR, strict=True):
        joints = (
            f"{x:.6g},{y:.6g},{z:.6g},{1 if joint in (14, 15, 18, 19) else 2}"
            for joint, (x, y, z) in enumerate(frame)
        )
        rows.append(f"{FIRST_TICK + round(time * 1e7)},{','.join(joints)},")
    return {"joints.csv": ("\r\n".join(rows) + "\r\n").encode()}
