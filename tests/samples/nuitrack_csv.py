"""The known walk as Nuitrack's recorder documents it: metres, X to the right, Y up, Z away."""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.readers.landmarks.nuitrack_csv import JOINTS
from samples.motion import in_range, walk


def files(frames: int = 90) -> dict[str, bytes]:
    """A user in every frame, one more in a third of them, the serial a word."""
    shown = walk(frames)
    joints = in_range(shown)
    # Ours: X away from the sensor, Y to its left, Z up.
    points = np.stack([-joints[..., 1], joints[..., 2], joints[..., 0]], axis=-1)
    names = [f"JOINT_{joint}.{axis}" for joint in JOINTS.values() for axis in "xyz"]
    lines = [",".join(["", "timestamp", "serial", "id", *names, "JOINT_LEFT_KNEE.rot"])]
    for frame, time in enumerate(shown.times):
        for user in (1, 2) if frames // 3 <= frame < 2 * frames // 3 else (1,):
            place = points[frame, [NODE_INDEX[node] for node in JOINTS]] + 0.8 * (user - 1)
            cells = [str(len(lines) - 1), str(1715151474879921 + round(1e6 * time)), "AS3M323001D", str(user)]
            lines.append(",".join([*cells, *(f"{value:.7g}" for value in place.ravel()), "170.5"]))
    return {"skeleton.csv": ("\n".join(lines) + "\n").encode()}
