"""BVH motion files: Euler channels in any order per joint, offsets, end sites.

A joint's rotation is the product of its rotation channels in the sequence in which they stand, each in the
turned frame of the one before (intrinsic). Position channels replace the joint's OFFSET, they are not added
to it: Kinect exporters (Brekel) write both, and adding them doubles every bone. The file's world is Y up.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.captures.bvh_text import BvhText, parse
from kinemimic.pipeline.captures.format import Format
from kinemimic.pipeline.captures.recording import reading
from kinemimic.pipeline.captures.source import Source
from kinemimic.pipeline.captures.units import metres_per_unit
from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.defect import Defect
from kinemimic.pipeline.euler import local_rotations, world_positions
from kinemimic.pipeline.rotations import Y_UP_TO_Z_UP, angle_between
from kinemimic.pipeline.skeleton import TRACKED, Skeleton

Array = NDArray[np.float64]

FORMAT = Format(
    name="BVH",
    sensor="optical, inertial or Kinect",
    holds="a skeleton with Euler channels in any order",
    told_by="the keyword HIERARCHY",
)
_AXES = "XYZ"
# A T-pose is one frame, at most a few; a longer stillness is a subject who is not there (acquire.py).
_MAX_CALIBRATION = 5


def recognises(source: Source) -> bool:
    """True if the first word is HIERARCHY."""
    return source.head[0].split()[0].lower() == "hierarchy"


def read(source: Source) -> Clip:
    """The clip of all joints, end sites as `<parent>_end`; a leading calibration pose is dropped, and told.

    The clock starts at 0 with the file's first frame, so that a dropped first frame shows in the times.
    """
    bvh = parse(source)
    orders, euler, offsets = channels(bvh)
    names = tuple(joint.name for joint in bvh.joints)
    scale, unit = metres_per_unit(names, offsets, source.path)
    translations = offsets * scale
    parents = tuple(joint.parent for joint in bvh.joints)
    skeleton = Skeleton(names, parents, np.array([joint.offset for joint in bvh.joints]) * scale)
    rotations = local_rotations(euler, orders, Y_UP_TO_Z_UP)
    first, note = calibration_frames(euler, rotations)
    frames = len(euler) - first
    return Clip(
        skeleton=skeleton,
        times=np.arange(first, len(euler), dtype=np.float64) * bvh.frame_time,
        positions=world_positions(skeleton, translations, rotations, Y_UP_TO_Z_UP)[first:],
        states=np.full((frames, len(names)), TRACKED, dtype=np.uint8),
        passes=np.zeros(frames, dtype=np.int32),
        euler=euler[first:],
        orders=orders,
        translations=translations[first:],
        world_from_file=Y_UP_TO_Z_UP.copy(),
        provenance={
            "format": FORMAT.name,
            "reading": reading(
                units=unit,
                units_rule="thigh and shank nearest to an adult's",
                defects=[Defect("calibration_frames", first, "frames", "repaired", note)] if first else [],
                channels=int(bvh.motion.shape[1]),
            ),
        },
    )


def channels(bvh: BvhText) -> tuple[tuple[str, ...], Array, Array]:
    """Per joint the intrinsic order (J,), angles (T, J, 3), radians, local positions (T, J, 3), file units.

    A joint with one or two rotation channels gets its missing axes as zeros at the end of its order.
    """
    shape = (len(bvh.motion), len(bvh.joints), 3)
    euler, local = np.zeros(shape), np.empty(shape)
    orders: list[str] = []
    column = 0
    for index, joint in enumerate(bvh.joints):
        local[:, index] = joint.offset
        order = ""
        for name in joint.channels:
            values = bvh.motion[:, column]
            if name.endswith("rotation"):
                euler[:, index, len(order)] = np.radians(values)
                order += name[0]
            else:
                local[:, index, _AXES.index(name[0])] = values
            column += 1
        orders.append(order + "".join(axis for axis in _AXES if order and axis not in order))
    return tuple(orders), euler, local


def calibration_frames(euler: Array, rotations: Array) -> tuple[int, str]:
    """How many leading frames are poses put before the motion (a T-pose), and what shows it.

    Two things together: their channels are whole degrees (most of them 0), which recorded angles never are;
    and the joints jump from the last of them into the motion by ten times their usual step.
    euler: (T, J, 3); rotations: (T, J, 4).
    """
    moving = np.ptp(euler, axis=0) > 0
    degrees = np.degrees(euler[:, moving])
    whole = (np.abs(degrees - np.round(degrees)) < 1e-6).mean(axis=1) if moving.any() else np.ones(len(euler))
    lead = int(np.argmin(whole > 0.9))
    if not 0 < lead <= _MAX_CALIBRATION or np.median(whole) > 0.5 or len(euler) < lead + 3:
        return 0, ""
    steps = angle_between(rotations[:-1], rotations[1:])[:, moving.any(axis=-1)].mean(axis=-1)
    if steps[lead - 1] < 10.0 * max(float(np.median(steps[lead:])), 1e-9):
        return 0, ""
    frames = "frame 0 is a calibration pose" if lead == 1 else f"frames 0 to {lead - 1} are calibration poses"
    return lead, (
        f"{frames}, dropped: whole degrees in {100 * whole[0]:.0f} % of the moving channels, and "
        f"{np.degrees(steps[lead - 1]):.0f} deg a joint from frame {lead}"
    )
