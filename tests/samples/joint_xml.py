"""XML of a Kinect v1's joints by name, of the people in each frame, as .NET's serialisation writes it."""

from __future__ import annotations

from samples.joint_table import NAMES
from samples.motion import walk, y_up


def files(frames: int = 90) -> dict[str, bytes]:
    """Milliseconds and metres, Y up."""
    motion = walk(frames)
    lines = ['<?xml version="1.0" encoding="utf-8"?>', "<Recording>", "<Frames>"]
    for time, points in zip(motion.times, y_up(motion.joints).tolist(), strict=True):
        lines += [f"<Frame><Timestamp>{1000.0 * time:.1f}</Timestamp><Skeletons><Skeleton><Joints>"]
        lines += [
            f"<Joint><JointType>{name}</JointType><Position><X>{x:.6f}</X><Y>{y:.6f}</Y><Z>{z:.6f}</Z></Position>"
            "<TrackingState>Tracked</TrackingState></Joint>"
            for name, (x, y, z) in zip(NAMES, points, strict=True)
        ]
        lines += ["</Joints><TrackingId>17</TrackingId></Skeleton></Skeletons></Frame>"]
    return {"joints.xml": "\n".join([*lines, "</Frames>", "</Recording>", ""]).encode()}
