"""Kinect v2 recordings as `.skl` text: a header line, then one line per frame, 25 joints.

Columns: timestamp (100 ns ticks in most files, ms in some; detected from its step), framenum, per joint X Y Z
tracked, FloorPlane_A..D. Positions are metres, Y up, already relative to the floor.

The recorder filled its columns in the order of the SDK's JointType, but three versions of it wrote three
other orders of names above them. The right names are therefore detected from the bone lengths that they give.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.column_names import DESCRIBE
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import zero_frames
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK, SDK_JOINTS, SDK_PARENTS, kinect_v2_skeleton
from kinemimic.pipeline.readers.kinect.skl_text import (
    Frames,
    Header,
    frames_of,
    header_of,
    is_kinect_v2,
    joint_columns,
    unread_columns,
)

FORMAT = Format(
    name="Kinect v2 .skl text",
    sensor="Kinect v2",
    holds="positions and states of 25 joints",
    recognised_by="a header Name_X Name_Y Name_Z Name_tracked … with joints that only a Kinect v2 has",
    columns=(106,),
)
_CLOCKS = ("100 ns", "ms")
# A v1 name that one of the recorders kept for the same joint.
_V1_NAMES = {"shouldercenter": "spineshoulder"}
_NAMES = frozenset((*_V1_NAMES, *(joint.lower() for joint in SDK_JOINTS)))

# Joint -> usual length in metres of the bone that ends there, as a Kinect v2 sees an adult. Hands are
# omitted: inferred hands have any length.
_ADULT_LENGTHS: dict[str, float] = {"SpineMid": 0.31, "SpineShoulder": 0.23, "Neck": 0.075, "Head": 0.15} | {
    f"{joint}{side}": length
    for side in ("Left", "Right")
    for joint, length in (
        ("Shoulder", 0.17), ("Elbow", 0.26), ("Wrist", 0.24), ("Hip", 0.075), ("Knee", 0.39), ("Ankle", 0.37),
        ("Foot", 0.14),
    )
}  # fmt: skip
_UNITS = (1.0, 0.01, 0.001)  # metres, centimetres, millimetres
# Medians over this many frames, evenly spread, are as good as over all.
_SAMPLED_FRAMES = 1000
# Real bones are within a fifth of these lengths, a child's all half of them; names in a wrong order are off
# by a factor of two in the mean.
_MAX_FACTOR = 1.7


@dataclass(frozen=True)
class JointOrder:
    """One assignment of names to the 25 joint columns of a line.

    label: its name in reports; indices: (25,) column index of the SDK's joint k; bones: metres, for each of
    _ADULT_LENGTHS; factor: (geometric) mean factor between these bones and an adult's.
    """

    label: str
    indices: tuple[int, ...]
    bones: dict[str, float]
    factor: float


def recognises(source: Source) -> bool:
    """True if the first line is a header of joint columns with joints that only a Kinect v2 has."""
    return is_kinect_v2(joint_columns(source))


def read(source: Source) -> Clip:
    """The clip of 25 joints, with the names that give human bones.

    Lines with a repeated or earlier time are dropped and counted. Raises CaptureError if no names give human
    bones.
    """
    header = header_of(source)
    joints, others = header.joints, list[str]()
    if len(joints) != len(SDK_JOINTS):
        others = [joint for joint in joints if joint.lower() not in _NAMES]
        header = replace(header, joints=tuple(joint for joint in joints if joint not in others))
    if len(header.joints) != len(SDK_JOINTS):
        raise source.error(
            expected="the 25 joints of a Kinect v2",
            found=f"{len(joints)} joints",
            line=header.line,
            advice=f"restore the columns, {DESCRIBE}",
        )
    frames = frames_of(source, header, header.joints, sensor=FORMAT.sensor, usual_clocks=_CLOCKS)
    order, defects = _choose_order(source, header, frames)
    indices = [order.indices[k] for k in FROM_SDK]
    return clip_of_points(
        kinect_v2_skeleton(),
        frames.times,
        frames.points[:, indices],
        frames.states[:, indices],
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the format's",
            defects=[*frames.defects, *zero_frames(frames.points), *defects],
            notes=[*frames.notes, *unread_columns(others, FORMAT.sensor)],
            columns=len(header.columns),
            joint_order=order.label,
            **frames.facts,
        ),
    )


def _choose_order(source: Source, header: Header, frames: Frames) -> tuple[JointOrder, list[Defect]]:
    """The order that gives human bones, and a defect if it is not the header's."""
    sdk = order_of("the SDK's order", tuple(range(len(SDK_JOINTS))), frames)
    named_indices = _header_order(header)
    from_header = order_of("the header's names", named_indices, frames) if named_indices else None
    # The header is preferred unless the SDK's order fits better.
    best = from_header if from_header and from_header.factor <= sdk.factor else sdk
    if not best.factor <= _MAX_FACTOR:
        raise source.error(
            expected=f"bones within a factor of {_MAX_FACTOR:g} of an adult's, with either order of names",
            found=f"a factor of {best.factor:.2f} (right thigh {best.bones['KneeRight']:.2f} m)",
        )
    if best.indices == named_indices:
        return best, []
    if from_header is None:
        text = f"the header's names are not the 25 of the SDK; with {sdk.label} {_evidence(sdk, sdk)}"
    else:
        text = (
            f"with {from_header.label} {_evidence(from_header, sdk)}; "
            f"with {sdk.label} {_evidence(sdk, from_header)}"
        )
    wrong = len(SDK_JOINTS)
    if named_indices is not None:
        wrong = sum(a != b for a, b in zip(named_indices, sdk.indices, strict=True))
    return best, [Defect("wrong_names", wrong, "joints", "repaired", f"{text}: read in the SDK's order")]


def _evidence(order: JointOrder, other: JointOrder) -> str:
    """The lengths that argue for or against an order: the thigh, and the bone for which two orders differ
    most."""
    pairs = {
        joint: abs(np.log(max(length, 1e-4) / max(other.bones[joint], 1e-4)))
        for joint, length in order.bones.items()
        if np.isfinite(length) and np.isfinite(other.bones[joint])
    }
    shown = dict.fromkeys(("KneeRight", max(pairs, key=lambda joint: pairs[joint])))
    lengths = ", ".join(
        f"{SDK_PARENTS[SDK_JOINTS.index(joint)]}-{joint} {order.bones[joint]:.2f} m" for joint in shown
    )
    return f"{lengths}, bones differ from an adult's by a factor of {order.factor:.2f}"


def _header_order(header: Header) -> tuple[int, ...] | None:
    """Index of each SDK joint according to the header's names; None if they are not those 25."""
    names = [_V1_NAMES.get(name.lower(), name.lower()) for name in header.joints]
    wanted = [name.lower() for name in SDK_JOINTS]
    return tuple(names.index(name) for name in wanted) if sorted(names) == sorted(wanted) else None


def order_of(label: str, indices: tuple[int, ...], frames: Frames) -> JointOrder:
    """The order with the bone lengths that it gives, in metres.

    The unit is the one in which the bones are nearest to an adult's, as no order changes them by a factor of
    ten; quality/rules/wrong_units.py scales the clip. The variation of lengths over time would not help: any
    two points of one body keep roughly their distance.
    """
    some = slice(None, None, 1 + len(frames.times) // _SAMPLED_FRAMES)
    points, states = frames.points[some], frames.states[some]
    seen = np.where((states > 0)[..., None] & np.isfinite(points), points, np.nan)

    def distance(a: str, b: str) -> float:
        ends = (seen[:, indices[SDK_JOINTS.index(name)]] for name in (a, b))
        length = np.linalg.norm(np.subtract(*ends), axis=-1)
        length = length[np.isfinite(length)]
        return float(np.median(length)) if len(length) else np.nan

    bones = {joint: distance(joint, SDK_PARENTS[SDK_JOINTS.index(joint)]) for joint in _ADULT_LENGTHS}
    ratios = np.maximum(list(bones.values()), 1e-4) / np.array(list(_ADULT_LENGTHS.values()))
    known = ratios[np.isfinite(ratios)]
    unit = min(_UNITS, key=lambda unit: abs(np.log(unit) + np.mean(np.log(known)))) if len(known) else 1.0
    bones, known = {joint: unit * length for joint, length in bones.items()}, unit * known
    # Too few bones are not evidence of a body.
    enough = len(known) > len(bones) // 2
    factor = float(np.exp(np.mean(np.abs(np.log(known))))) if enough else np.inf
    return JointOrder(label, indices, bones, factor)
