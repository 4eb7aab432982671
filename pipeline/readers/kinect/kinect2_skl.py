"""Kinect v2 recordings as `.skl` text: a header line, then one line a frame, 25 joints.

Columns: timestamp (100 ns ticks in most, ms in some: told by its step), framenum, per joint X Y Z tracked,
FloorPlane_A..D. Positions are metres, Y up, already referred to the floor.

The recorder filled its columns in the sequence of the SDK's JointType, but three versions of it wrote three
other sequences of names over them. Which names are true is therefore told by the bones that they give.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import zero_frames
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.kinect.kinect_v2 import FROM_SDK, SDK_JOINTS, SDK_PARENTS, kinect_v2_skeleton
from kinemimic.pipeline.readers.kinect.skl_text import (
    Frames,
    Header,
    frames_of,
    header_of,
    joint_columns,
    of_kinect_v2,
)

FORMAT = Format(
    name="Kinect v2 .skl text",
    sensor="Kinect v2",
    holds="positions and states of 25 joints",
    recognised_by="a header Name_X Name_Y Name_Z Name_tracked … with joints that only a Kinect v2 has",
    columns=(106,),
)
_CLOCKS = {"100 ns": 1e7, "ms": 1e3}
# A v1 name that one of the recorders kept for the same place.
_OTHER_NAMES = {"shouldercenter": "spineshoulder"}

# Bone that ends at a joint -> its usual length in metres as a Kinect v2 sees an adult. Hands are left out:
# where they are inferred they have any length.
_LENGTHS: dict[str, float] = {"SpineMid": 0.31, "SpineShoulder": 0.23, "Neck": 0.075, "Head": 0.15} | {
    f"{joint}{side}": length
    for side in ("Left", "Right")
    for joint, length in (
        ("Shoulder", 0.17), ("Elbow", 0.26), ("Wrist", 0.24), ("Hip", 0.075), ("Knee", 0.39), ("Ankle", 0.37),
        ("Foot", 0.14),
    )
}  # fmt: skip
# Medians over so many frames, evenly spread, are as good as over all.
_ENOUGH_FRAMES = 1000
# Typical bones are within a fifth of these lengths, and a child's all half of them; names in a wrong
# sequence are off by a factor of two in the mean.
_HUMAN = 1.7


@dataclass(frozen=True)
class Order:
    """One way to name the 25 places of a line.

    told: how a report calls it; places: (25,) which place of the line is the SDK's joint number k;
    bones: metres, for each of _LENGTHS; factor: by how much they are off those, in the (geometric) mean.
    """

    told: str
    places: tuple[int, ...]
    bones: dict[str, float]
    factor: float


def recognises(source: Source) -> bool:
    """True if the first line is a header of joint columns with joints that only a Kinect v2 has."""
    return of_kinect_v2(joint_columns(source.head[0]))


def read(source: Source) -> Clip:
    """The clip of 25 joints, under the names that give human bones.

    Lines with a repeated or earlier time are dropped and counted. CaptureError if no names give a human.
    """
    header = header_of(source)
    if len(header.joints) != len(SDK_JOINTS):
        raise source.error(
            expected="the 25 joints of a Kinect v2",
            found=f"{len(header.joints)} joints",
            where=f"line {header.line}",
        )
    frames = frames_of(source, header, header.joints, _CLOCKS)
    order, defects = _named(source, header, frames)
    places = [order.places[k] for k in FROM_SDK]
    return clip_of_points(
        kinect_v2_skeleton(),
        frames.times,
        frames.points[:, places],
        frames.states[:, places],
        format=FORMAT,
        reading=reading(
            units="m",
            units_rule="the format's",
            defects=[*frames.defects, *zero_frames(frames.points), *defects],
            columns=len(header.columns),
            clock=frames.unit,
            joint_order=order.told,
        ),
    )


def _named(source: Source, header: Header, frames: Frames) -> tuple[Order, list[Defect]]:
    """The true order, and a defect if it is not the header's."""
    sdk = order_of("the SDK's order", tuple(range(len(SDK_JOINTS))), frames)
    named = _header_order(header)
    written = order_of("the header's names", named, frames) if named else None
    # The header is believed wherever nothing speaks against it.
    best = written if written and written.factor <= sdk.factor else sdk
    if not best.factor <= _HUMAN:
        raise source.error(
            expected=f"bones within a factor of {_HUMAN:g} of an adult's, by either order of names",
            found=f"a factor of {best.factor:.2f} (right thigh {best.bones['KneeRight']:.2f} m)",
        )
    if best.places == named:
        return best, []
    if written is None:
        text = f"the header's names are not the 25 of the SDK; by {sdk.told} {_evidence(sdk, sdk)}"
    else:
        text = f"by {written.told} {_evidence(written, sdk)}; by {sdk.told} {_evidence(sdk, written)}"
    wrong = len(SDK_JOINTS) if named is None else sum(a != b for a, b in zip(named, sdk.places, strict=True))
    return best, [Defect("wrong_names", wrong, "joints", "repaired", f"{text}: read in the SDK's order")]


def _evidence(order: Order, other: Order) -> str:
    """Thigh, and the bone over which two orders are most at odds, of one of them."""
    pairs = {
        joint: abs(np.log(max(length, 1e-4) / max(other.bones[joint], 1e-4)))
        for joint, length in order.bones.items()
        if np.isfinite(length) and np.isfinite(other.bones[joint])
    }
    shown = dict.fromkeys(("KneeRight", max(pairs, key=lambda joint: pairs[joint])))
    lengths = ", ".join(
        f"{SDK_PARENTS[SDK_JOINTS.index(joint)]}-{joint} {order.bones[joint]:.2f} m" for joint in shown
    )
    return f"{lengths}, bones off an adult's by a factor of {order.factor:.2f}"


def _header_order(header: Header) -> tuple[int, ...] | None:
    """Place of each SDK joint by the header's names; None if they are not those 25."""
    names = [_OTHER_NAMES.get(name.lower(), name.lower()) for name in header.joints]
    wanted = [name.lower() for name in SDK_JOINTS]
    return tuple(names.index(name) for name in wanted) if sorted(names) == sorted(wanted) else None


def order_of(told: str, places: tuple[int, ...], frames: Frames) -> Order:
    """What bones the frames have if place places[k] of a line is the SDK's joint k.

    Their spread over time would not tell: any two places of one body keep about their distance.
    """
    some = slice(None, None, 1 + len(frames.times) // _ENOUGH_FRAMES)
    points, states = frames.points[some], frames.states[some]
    seen = np.where((states > 0)[..., None] & np.isfinite(points), points, np.nan)

    def distance(a: str, b: str) -> float:
        ends = (seen[:, places[SDK_JOINTS.index(name)]] for name in (a, b))
        length = np.linalg.norm(np.subtract(*ends), axis=-1)
        length = length[np.isfinite(length)]
        return float(np.median(length)) if len(length) else np.nan

    bones = {joint: distance(joint, SDK_PARENTS[SDK_JOINTS.index(joint)]) for joint in _LENGTHS}
    ratios = np.maximum(list(bones.values()), 1e-4) / np.array(list(_LENGTHS.values()))
    known = ratios[np.isfinite(ratios)]
    # Too few bones to judge by are no evidence of a body.
    enough = len(known) > len(bones) // 2
    factor = float(np.exp(np.mean(np.abs(np.log(known))))) if enough else np.inf
    return Order(told, places, bones, factor)
