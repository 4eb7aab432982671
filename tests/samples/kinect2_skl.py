"""Kinect v2 .skl: values in the SDK's order under names in another, 100 ns ticks."""

from __future__ import annotations

from samples.motion import Walk, in_range, kinect_v2_joints, walk, y_up
from samples.nui_skl import header

_ARM = ("Shoulder", "Elbow", "Wrist", "Hand", "HandTip", "Thumb")
_LEG = ("Hip", "Knee", "Ankle", "Foot")
SDK: tuple[str, ...] = (
    *("SpineBase", "SpineMid", "Neck", "Head"),
    *(f"{joint}{side}" for side in ("Left", "Right") for joint in _ARM[:4]),
    *(f"{joint}{side}" for side in ("Left", "Right") for joint in _LEG),
    *("SpineShoulder", "HandTipLeft", "ThumbLeft", "HandTipRight", "ThumbRight"),
)
# The names of one of the recorders: the trunk upside down, hands whole, one joint under its v1 name.
WRONG: tuple[str, ...] = (
    *("SpineMid", "SpineBase", "ShoulderCenter", "Head", "Neck"),
    *(f"{joint}{side}" for side in ("Left", "Right") for joint in _ARM),
    *(f"{joint}{side}" for side in ("Left", "Right") for joint in _LEG),
)


def text(frames: int, names: tuple[str, ...], *, tick: float = 1e-7) -> str:
    """The file under the given names; tick: the clock's unit in seconds."""
    seen = walk(frames)
    points = y_up(kinect_v2_joints(Walk(seen.times, in_range(seen), seen.angles)))
    lines = [header(names)]
    for k, frame in enumerate(points):
        places = "\t".join(f"{x:.15g}\t{y:.15g}\t{z:.15g}\t2" for x, y, z in frame)
        lines.append(f"{(25010.7 + 0.0330377 * k) / tick:.12g}\t{k}\t{places}\t0.018\t0.9989\t0.0429\t0.6962")
    return "\r\n".join([*lines, ""])


def files(frames: int = 90) -> dict[str, bytes]:
    """One file whose header is wrong."""
    return {"walk_v2.skl": text(frames, WRONG).encode()}
