"""The raw dump of Kinect2BVH: blocks of positions and quaternions of the joints that are tracked."""

from __future__ import annotations

from samples.motion import Walk, in_range, kinect_v2_joints, walk, y_up

# Tips and thumbs come and go.
TIPS = (21, 22, 23, 24)


def text(frames: int, joints: tuple[int, ...] = tuple(range(25))) -> str:
    """The dump with the SDK joints of these indices; every third block has no tips."""
    seen = walk(frames)
    points = y_up(kinect_v2_joints(Walk(seen.times, in_range(seen), seen.angles)))
    lines = []
    for k, frame in enumerate(points):
        there = [j for j in joints if k % 3 or j not in TIPS]
        lines += [f"{3178718 + round(100 * k / 3)}", f"Pos {len(there)}"]
        lines += [f"{j} " + " ".join(f"{x:.6f}" for x in frame[j]) for j in there]
        lines += [f"Rot {len(there)}"] + [f"{j} 0.008109 0.994914 0.096044 -0.029243" for j in there]
    return "\n".join([*lines, ""])


def files(frames: int = 90) -> dict[str, bytes]:
    """One file of all 25 joints."""
    return {"raw.txt": text(frames).encode()}
