"""BVH motion files: Euler channels in any order per joint, offsets, end sites.

A joint's rotation is the product of its rotation channels in the order of the file, each in the frame rotated
by the one before (intrinsic). Position channels replace the joint's OFFSET and are not added to it: Kinect
exporters (Brekel) write both, and adding them would double every bone. Only where they would leave no bones,
as the zeros that some tools write for every joint, are they added. Scale channels are not applied: bones
have the lengths of the hierarchy. The file's world is Y up, or Z up if its skeleton stands along Z (Blender).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.euler import positions_of_channels, rotations_of_channels
from kinemimic.pipeline.kinematics.joint_names import REQUIRED, joints_by_name
from kinemimic.pipeline.kinematics.joints_by_tree import named_by_tree
from kinemimic.pipeline.kinematics.rotations import IDENTITY, Y_UP_TO_Z_UP, angle_between, rotate
from kinemimic.pipeline.kinematics.skeleton import Skeleton
from kinemimic.pipeline.kinematics.vectors import unit as unit_of
from kinemimic.pipeline.plural import plural
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import infer_unit
from kinemimic.pipeline.readers.base.clip_building import clip_of_channels, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.path_unit import MIXED, path_factor
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap.angle_unit import radians_defect
from kinemimic.pipeline.readers.mocap.bvh_text import BvhText, is_comment, parse

FORMAT = Format(
    name="BVH",
    sensor="optical, inertial or Kinect",
    holds="a skeleton with Euler channels in any order",
    recognised_by="the keyword HIERARCHY",
    width_in_header=True,
)
# Of a file without a frame time, in Hz.
RATE = 30.0
_AXES = "XYZ"
# Share of an OFFSET's length below which position channels cannot be in place of it.
_NO_BONE = 0.1
# Cosine of the angle to Z within which a trunk or a leg stands.
_UPRIGHT = 0.8
# Share of a leg within which a root is at the pelvis.
_PELVIS = 0.4
# A T-pose is one frame, at most a few; a longer still pose means that the subject is not there yet
# (quality/passes.py).
_MAX_CALIBRATION = 5
# Enough frames for the median step of a motion.
_SAMPLED_FRAMES = 600


def recognises(source: Source) -> bool:
    """True if the first word below comments is HIERARCHY."""
    first = next((line for line in source.head if not is_comment(line)), source.head[0])
    return first.split()[0].lower() == "hierarchy"


def read(source: Source) -> Clip:
    """The clip of all joints, end sites as `<parent>_end`; a leading calibration pose is dropped and
    reported.

    The clock starts at 0 with the file's first frame, so a dropped first frame shows in the times. So do
    frames without a number in some channel, which are left out: kinematics needs every joint.
    """
    bvh = parse(source)
    if not bvh.motion.any():
        raise source.error(
            expected="a motion",
            found=f"every channel is zero in all {len(bvh.motion)} frames",
            advice="no motion was recorded, or the exporter failed",
        )
    orders, euler, offsets = channels(bvh)
    relative = _add_offsets(bvh, offsets)
    parents = tuple(joint.parent for joint in bvh.joints)
    some = slice(None, None, len(euler) // _SAMPLED_FRAMES + 1)
    named = Skeleton(
        tuple(joint.name for joint in bvh.joints), parents, np.array([joint.offset for joint in bvh.joints])
    )
    posed = positions_of_channels(named, offsets[some], euler[some], orders, IDENTITY)
    in_radians = radians_defect(np.degrees(euler[some, 1:]), posed)
    if in_radians is not None:
        np.degrees(euler, out=euler)
        posed = positions_of_channels(named, offsets[some], euler[some], orders, IDENTITY)
    names, by_tree = named_by_tree(named.names, parents, posed)
    z_up = _stands_along_z(replace(named, names=names), posed)
    unit = infer_unit(names, parents, offsets, source.path, named=source.unit)
    translations = offsets * unit.metres
    skeleton = Skeleton(names, parents, named.offsets * unit.metres)
    seconds = bvh.frame_time or 1.0 / RATE
    world = IDENTITY if z_up else Y_UP_TO_Z_UP
    in_world = rotate(world, posed * unit.metres)
    path_scale, path_defects = _path(names, in_world, 1.0 / (seconds * (some.step or 1)))
    translations[:, 0] *= path_scale
    first, note = calibration_frames(euler, orders)
    defects = [*unit.defects, *path_defects, *([] if in_radians is None else [in_radians])]
    if first:
        defects.append(Defect("calibration_frames", first, "frames", "repaired", note))
    notes = [by_tree] if by_tree else []
    if relative:
        notes.append("position channels below the root are about zero: they are added to the offsets")
    if z_up:
        notes.append("the skeleton stands along Z in the file: Z is up")
    of_text, also = _findings(bvh)
    return clip_of_channels(
        skeleton,
        bvh.numbers[first:].astype(np.float64) * seconds,
        translations[first:],
        euler[first:],
        orders,
        format=FORMAT,
        reading=reading(
            units=unit.name,
            units_rule=unit.rule,
            defects=[*defects, *of_text],
            notes=[*notes, *also],
            channels=int(bvh.motion.shape[1]),
        ),
        world_from_file=world,
    )


def _findings(bvh: BvhText) -> tuple[list[Defect], list[str]]:
    """Defects and notes about the text of a file."""
    frames, read = int(bvh.numbers[-1]) + 1, len(bvh.motion)
    defects, notes = [], []
    if bvh.commas:
        notes.append("the numbers have decimal commas")
    if any(name.endswith("scale") for joint in bvh.joints for name in joint.channels):
        notes.append("the file has scale channels, which are not applied")
    if bvh.declared > frames:
        text = f"the file declares {bvh.declared} frames but has {frames}: it may be cut off"
        defects.append(Defect("dropped_frames", bvh.declared - frames, "frames", "flagged", text))
    elif 0 < bvh.declared < frames:
        notes.append(f"the file declares {bvh.declared} frames but has {frames}: all are read")
    if bvh.cut:
        text = "the last frame is cut off, and left out"
        defects.append(Defect("dropped_frames", 1, "frames", "flagged", text))
    if unknown := frames - read:
        text = f"{plural(unknown, 'frame')} without a number in some channel, left out"
        defects.append(Defect("dropped_frames", unknown, "frames", "flagged", text))
    roots = ", ".join(bvh.others)[:80]
    if bvh.people:
        text = f"{bvh.people} more in the file, dropped; its other roots are {roots}"
        defects.append(Defect("several_people", bvh.people, "people", "repaired", text))
    elif bvh.others:
        notes.append(f"other roots are not read: {roots}")
    if not bvh.frame_time:
        text = f"the file has no frame time: {RATE:g} Hz, unless --rate says what it has"
        defects.append(Defect("wrong_rate", read, "frames", "flagged", text))
    return defects, notes


def _path(names: tuple[str, ...], positions: Array, rate: float) -> tuple[float, list[Defect]]:
    """The factor that the path of the root needs, and a defect unless it is 1.

    positions: (T, J, 3) of the joints in metres, Z up; rate: Hz. Of a root that is not at the pelvis, nothing
    is known.
    """
    found = joints_by_name(names)
    if not {"hip_left", "hip_right", "ankle_left", "ankle_right"} <= found.keys():
        return 1.0, []
    root = positions[:, 0]
    feet = positions[:, [found["ankle_left"], found["ankle_right"]]] - root[:, None]
    hips = 0.5 * (positions[:, found["hip_left"]] + positions[:, found["hip_right"]])
    leg = float(np.median(np.linalg.norm(feet, axis=-1)))
    if float(np.median(np.linalg.norm(hips - root, axis=-1))) > _PELVIS * leg:
        return 1.0, []
    factor, why = path_factor(root, feet, rate, MIXED)
    if factor == 1.0:
        return 1.0, []
    text = f"the root's path is in another unit than the bones: {why}; times {factor:g}"
    return factor, [Defect("wrong_units", len(positions), "frames", "repaired", text)]


def _add_offsets(bvh: BvhText, local: Array) -> bool:
    """Add the OFFSETs to local positions (T, J, 3), in place, if their channels are counted from these; and
    whether they were.

    Then the channels of nearly all joints are nearly zero; those that replace an OFFSET are as long as it.
    """
    sizes = np.linalg.norm([joint.offset for joint in bvh.joints], axis=1)
    moved = [
        k
        for k, joint in enumerate(bvh.joints)
        if joint.parent >= 0 and sizes[k] > 0.0 and any(name.endswith("position") for name in joint.channels)
    ]
    shares = [float(np.median(np.linalg.norm(local[:, k], axis=-1))) / sizes[k] for k in moved]
    if not shares or np.median(shares) > _NO_BONE:
        return False
    local[:, moved] += np.array([bvh.joints[k].offset for k in moved])
    return True


def _stands_along_z(skeleton: Skeleton, posed: Array) -> bool:
    """Whether a body stands along Z at rest, as its offsets place it, and its trunk in most of the frames
    (T, J, 3), all in the file's axes.

    A skeleton that stands along another axis at rest, or along none, says nothing about Z: then somebody may
    lie on the floor.
    """
    rest = skeleton.offsets.copy()
    for joint, parent in enumerate(skeleton.parents):
        rest[joint] += rest[parent] if parent >= 0 else 0.0
    resting, moving = (_heights(skeleton.names, points) for points in (rest[None], posed))
    if resting is None or moving is None:
        return False
    return min(float(np.min(resting)), float(np.median(moving[0]))) > _UPRIGHT


def _heights(names: tuple[str, ...], points: Array) -> tuple[Array, Array] | None:
    """Share of its length (T,) by which the trunk rises along Z, and the legs; None without these."""
    found = joints_by_name(names)
    top = next((found[node] for node in ("shoulder_center", "head", "shoulder_left") if node in found), None)
    if top is None or not set(REQUIRED) <= found.keys():
        return None
    hips, ankles = (
        0.5 * (points[:, found[f"{joint}_left"]] + points[:, found[f"{joint}_right"]])
        for joint in ("hip", "ankle")
    )
    return unit_of(points[:, top] - hips)[:, 2], unit_of(hips - ankles)[:, 2]


def channels(bvh: BvhText) -> tuple[tuple[str, ...], Array, Array]:
    """Per joint the intrinsic order (J,), angles (T, J, 3) in radians, local positions (T, J, 3) in file
    units.

    A joint with one or two rotation channels gets its missing axes as zeros at the end of its order.
    """
    shape = (len(bvh.motion), len(bvh.joints), 3)
    euler, local = np.zeros(shape), np.empty(shape)
    local[:] = [joint.offset for joint in bvh.joints]
    orders: list[str] = []
    # Index among all joints' triples -> column of the file.
    rotation_columns: dict[int, int] = {}
    position_columns: dict[int, int] = {}
    column = 0
    for index, joint in enumerate(bvh.joints):
        order = ""
        for name in joint.channels:
            if name.endswith("rotation"):
                rotation_columns[3 * index + len(order)] = column
                order += name[0]
            elif name.endswith("position"):
                position_columns[3 * index + _AXES.index(name[0])] = column
            column += 1
        orders.append(order + "".join(axis for axis in _AXES if order and axis not in order))
    for array, slots in ((euler, rotation_columns), (local, position_columns)):
        array.reshape(len(array), -1)[:, list(slots)] = bvh.motion[:, list(slots.values())]
    return tuple(orders), np.radians(euler, out=euler), local


def calibration_frames(euler: Array, orders: tuple[str, ...]) -> tuple[int, str]:
    """Number of leading frames that are poses put before the motion (T-poses), and the evidence.

    Both must hold: their channels are whole degrees (most of them 0), which recorded angles never are, and
    the joints jump from the last of them into the motion by ten times their usual step. euler: (T, J, 3)
    radians in the sequence of orders (J,).
    """
    if len(euler) > _SAMPLED_FRAMES:
        euler = euler[:_SAMPLED_FRAMES]
    moving = np.ptp(euler, axis=0) > 0
    degrees = np.degrees(euler[:, moving])
    whole = (np.abs(degrees - np.round(degrees)) < 1e-6).mean(axis=1) if moving.any() else np.ones(len(euler))
    leading = int(np.argmin(whole > 0.9))
    if not 0 < leading <= _MAX_CALIBRATION or np.median(whole) > 0.5 or len(euler) < leading + 3:
        return 0, ""
    rotations = rotations_of_channels(euler, orders, Y_UP_TO_Z_UP)
    steps = angle_between(rotations[:-1], rotations[1:])[:, moving.any(axis=-1)].mean(axis=-1)
    if steps[leading - 1] < 10.0 * max(float(np.median(steps[leading:])), 1e-9):
        return 0, ""
    frames = (
        "frame 0 is a calibration pose"
        if leading == 1
        else f"frames 0 to {leading - 1} are calibration poses"
    )
    return leading, (
        f"{frames}, dropped: whole degrees in {100 * whole[0]:.0f} % of the moving channels, and "
        f"{np.degrees(steps[leading - 1]):.0f} deg per joint to frame {leading}"
    )
