"""Check Euler channels for gimbal lock and flips, joint by joint.

Converting Euler angles to quaternions is never singular. Near lock, the split between the first and the third
angle is lost: for three different axes (Tait-Bryan) at a middle angle of +-90 degrees, for a repeated axis
(proper Euler) at 0 or 180. The paper's text speaks of 180 degrees, which fits a proper order; its Eq. 8 is a
Tait-Bryan order.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.euler import order_name
from kinemimic.pipeline.kinematics.rotations import angle_between
from kinemimic.pipeline.kinematics.spans import runs

GIMBAL_SCHEMA = 1

NEAR_LOCK = np.radians(5.0)
JUMP = np.radians(45.0)


def distance_from_lock(middle: Array, order: str) -> Array:
    """Angle (...,) from middle angles (...,) to the nearest lock of `order`, 0 to pi/2, radians."""
    from_half_turn = np.abs(np.mod(np.asarray(middle) + np.pi / 2, np.pi) - np.pi / 2)
    return np.asarray(from_half_turn if order[0] == order[2] else np.pi / 2 - from_half_turn)


def flips(euler: Array, rotations: Array) -> NDArray[np.intp]:
    """Frames at which the angles jump although the rotation hardly changes.

    A jump: since the previous frame a channel changes by more than 45 degrees, modulo 360, and by more than
    twice the angle of the rotation. euler: (T, 3) radians; rotations: (T, 4).
    """
    change = np.diff(euler, axis=0)
    jump = np.abs(np.mod(change + np.pi, 2 * np.pi) - np.pi).max(axis=-1)
    turned = angle_between(rotations[:-1], rotations[1:])
    return np.flatnonzero((jump > JUMP) & (jump > 2.0 * turned)) + 1


def gimbal_report(clip: Clip, rotations: Array | None) -> dict[str, Any]:
    """The report as JSON values: every joint with rotation channels that are not all zero or missing.

    rotations: (T, J, 4), those of clip.euler; None of a capture without. Frames count from the clip's
    first; those without an angle are ignored. A capture of positions has no channels and gives an empty list.
    """
    joints: list[dict[str, Any]] = []
    for joint, order in enumerate(clip.orders or ()):
        if (
            not order
            or clip.euler is None
            or rotations is None
            or not np.nan_to_num(clip.euler[:, joint]).any()
        ):
            continue
        distance = distance_from_lock(clip.euler[:, joint, 1], order)
        if not np.isfinite(distance).any():
            continue
        flagged = distance <= NEAR_LOCK
        nearest = int(np.nanargmin(distance))
        joints.append(
            {
                "joint": clip.skeleton.names[joint],
                "order": order_name(order),
                "lock_at_deg": [0, 180] if order[0] == order[2] else [-90, 90],
                "nearest_deg": round(float(np.degrees(distance[nearest])), 6),
                "nearest_frame": nearest,
                "flagged_frames": [[run.start, run.stop - 1] for run in runs(flagged)],
                "flips": flips(clip.euler[:, joint], rotations[:, joint]).tolist(),
            }
        )
    return {
        "schema": GIMBAL_SCHEMA,
        "frames": len(clip.times),
        "flag_within_deg": round(float(np.degrees(NEAR_LOCK)), 6),
        "flip_beyond_deg": round(float(np.degrees(JUMP)), 6),
        "joints": joints,
    }


def table(report: Mapping[str, Any]) -> RenderableType:
    """The report for a terminal: joints that are flagged or flip, and the three others nearest to lock."""
    joints = sorted(report["joints"], key=lambda joint: joint["nearest_deg"])
    if not joints:
        return Text("no Euler channels: orientations come from positions, which have no gimbal lock")
    marked = [joint for joint in joints if joint["flagged_frames"] or joint["flips"]]
    calm = [joint for joint in joints if joint not in marked]
    grid = Table("joint", "order", header_style="bold", box=None, pad_edge=False)
    grid.add_column("nearest, deg", justify="right")
    grid.add_column(f"frames within {report['flag_within_deg']:g} deg")
    grid.add_column("flips at frames")
    for joint in marked + calm[:3]:
        spans = [f"{first}-{last}" if last > first else f"{first}" for first, last in joint["flagged_frames"]]
        grid.add_row(
            joint["joint"],
            joint["order"],
            f"{joint['nearest_deg']:.2f}",
            _some(spans),
            _some([str(frame) for frame in joint["flips"]]),
        )
    title = (
        f"gimbal lock: {len(marked)} of {len(joints)} joints come near it or flip in {report['frames']} "
        "frames; the quaternions are not affected"
    )
    return Group(Text(title, no_wrap=True, overflow="ignore"), grid)


def _some(items: list[str], most: int = 6) -> str:
    if not items:
        return "-"
    return ", ".join(items[:most]) + (f" and {len(items) - most} more" if len(items) > most else "")
