"""Acclaim motion: an AMC file of angles with the ASF skeleton in the same folder.

A bone rotates in its own frame (`axis`), which is tilted relative to the world at rest: with C the rotation
of that frame and M the product of the bone's angles, a bone's rotation relative to its parent is C M C^-1
(Lander 1998, "Working with Motion Capture File Formats"). Here a joint is at the START of its bone and has
the frame C: its rest rotation is C_parent^-1 C, and its Euler channels are the file's. Orders are extrinsic:
`rx ry rz` is R = Rz Ry Rx. The file's world is Y up.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.euler import positions_of_channels
from kinemimic.pipeline.kinematics.joint_names import listed
from kinemimic.pipeline.kinematics.joints_by_tree import named_by_tree
from kinemimic.pipeline.kinematics.rotations import (
    IDENTITY,
    Y_UP_TO_Z_UP,
    conjugate,
    multiply,
    rotate,
)
from kinemimic.pipeline.kinematics.skeleton import Skeleton
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import infer_unit
from kinemimic.pipeline.readers.base.clip_building import clip_of_channels, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import increasing_times
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap import amc_text, asf_text
from kinemimic.pipeline.readers.mocap.angle_unit import radians_defect
from kinemimic.pipeline.readers.mocap.asf_text import ROTATIONS, AsfText

FORMAT = Format(
    name="ASF/AMC",
    sensor="optical",
    holds="a skeleton with Euler channels in the bones' own axes",
    recognised_by="the keyword :FULLY-SPECIFIED, or a frame's number with a line `root` below it",
    sidecar_file="the skeleton NAME.asf (02.asf for 02_01.amc)",
)
# CMU's library and HDM05 were recorded at 120 Hz, which their files do not state.
RATE = 120.0
_RATES = (5.0, 2000.0)
_RATE_KEYWORDS = (":SAMPLES-PER-SECOND", ":FRAMES-PER-SECOND")
_SUFFIXES = (".asf", ".asf.gz")
# Names of folders of skeletons.
_FOLDERS = ("asf", "skeleton", "skeletons")
_KNEES = {"knee_left": "ltibia", "knee_right": "rtibia"}
# Enough frames to see which joints bend.
_SAMPLED_FRAMES = 600
# A day at 120 Hz; larger frame numbers are damage.
_MAX_FRAME = 1e7


def recognises(source: Source) -> bool:
    """True for a motion, and for a skeleton, for which `read` explains what to read instead."""
    words = [line.split() for line in source.head]
    first = [word[0].upper() for word in words]
    if ":FULLY-SPECIFIED" in first or is_skeleton(source):
        return True
    numbers = [k for k, word in enumerate(words) if len(word) == 1 and word[0].isdigit()]
    return any(first[k + 1 : k + 2] == ["ROOT"] and len(words[k + 1]) == 7 for k in numbers[:1])


def is_skeleton(source: Source) -> bool:
    """True for an ASF file."""
    first = {line.split()[0].lower() for line in source.head}
    return ":bonedata" in first or {":root", ":units"} <= first


def read(source: Source) -> Clip:
    """The clip of a joint at the start of each bone, and one at the end of bones without children.

    The file has no clock: frames are 1/120 s apart unless it states a rate. Frames whose number is not
    greater than all before are dropped and reported. angles: the file's own knees, if the shin has one angle.
    """
    if is_skeleton(source):
        raise source.error(
            expected="a motion", found="a skeleton (ASF) alone",
            advice="pass the .amc file; the skeleton in the same folder is found",
        )  # fmt: skip
    skeleton_source, text = _find_skeleton(source)
    amc = amc_text.parse(source, {bone.name: len(bone.dofs) for bone in text.bones})
    degrees = text.degrees if ":RADIANS" not in amc.keywords else False
    degrees = degrees or ":DEGREES" in amc.keywords
    rate, rate_rule = _rate(source, amc.keywords)
    later, defects = _later(source, amc.numbers)
    values = amc.values if later.all() else {bone: array[later] for bone, array in amc.values.items()}

    names, parents, rests, offsets = _joints(text)
    orders, euler, root = _channels(text, values, len(names), degrees)
    translations = np.broadcast_to(offsets, (len(root), len(names), 3)).copy()
    translations[:, 0] = root
    some = slice(None, None, len(root) // _SAMPLED_FRAMES + 1)
    named = Skeleton(names, parents, offsets)
    places = positions_of_channels(named, translations[some], euler[some], orders, Y_UP_TO_Z_UP, rests)
    in_radians = None
    if degrees:
        in_radians = radians_defect(np.degrees(euler[some, 1:]), places)
    if in_radians is not None:
        degrees = False
        np.degrees(euler, out=euler)
        places = positions_of_channels(named, translations[some], euler[some], orders, Y_UP_TO_Z_UP, rests)
    names, by_tree = named_by_tree(names, parents, places)
    unit = infer_unit(names, parents, offsets[None], skeleton_source.path, named=source.unit)
    skeleton = Skeleton(names, parents, offsets * unit.metres)
    return clip_of_channels(
        skeleton,
        (amc.numbers[later] - amc.numbers[0]) / rate,
        translations * unit.metres,
        euler,
        orders,
        format=FORMAT,
        reading=reading(
            units=unit.name,
            units_rule=unit.rule,
            defects=[*unit.defects, *defects, *([] if in_radians is None else [in_radians])],
            notes=[rate_rule, *([by_tree] if by_tree else []), *_not_read(text)],
            skeleton=skeleton_source.path.name,
            skeleton_length_scale=text.length,
            channels=int(sum(len(bone.dofs) for bone in text.bones)),
        ),
        rests=rests,
        angles=_knees(text, values, degrees) or None,
    )


def _find_skeleton(source: Source) -> tuple[Source, AsfText]:
    """The skeleton of this motion: the one with its name, else with the longest prefix of it (CMU's 02.asf
    for 02_01.amc), else the only one in the folder; if that has none, in a folder of skeletons beside it."""
    found_files = _skeletons(source.path.parent) or _skeletons_beside(source)
    stem = source.path.name.split(".")[0].lower()
    fitting = [name for name in found_files if (stem + "_").startswith(_stem(name) + "_")]
    skeleton_name = max(fitting, key=len) if fitting else found_files[0] if len(found_files) == 1 else None
    skeleton_source = source.sidecar_file(skeleton_name) if skeleton_name else None
    if skeleton_source is None:
        listed = (
            f"{', '.join(found_files[:4])}{' …' if len(found_files) > 4 else ''}"
            if found_files
            else "no .asf file"
        )
        raise source.error(
            expected=f"its skeleton in the same folder, {stem}.asf or {stem.split('_')[0]}.asf", found=listed,
            advice="copy the skeleton that came with the motion there",
        )  # fmt: skip
    if not skeleton_source.is_text or not is_skeleton(skeleton_source):
        raise skeleton_source.error(expected="a skeleton (ASF)", found="something else")
    return skeleton_source, asf_text.parse(skeleton_source)


def _stem(name: str) -> str:
    return name.rpartition("/")[2].lower().removesuffix(".gz")[:-4]


def _skeletons(folder: Path) -> list[str]:
    try:
        return sorted(path.name for path in folder.iterdir() if path.name.lower().endswith(_SUFFIXES))
    except OSError:
        return []


def _skeletons_beside(source: Source) -> list[str]:
    """The skeletons in folders beside the motion's that are named after them, as "../asf/02.asf"."""
    try:
        folders = sorted(source.path.absolute().parent.parent.iterdir())
    except OSError:
        return []
    of_skeletons = (folder for folder in folders if folder.name.lower() in _FOLDERS)
    return [f"../{folder.name}/{name}" for folder in of_skeletons for name in _skeletons(folder)]


def _rate(source: Source, keywords: Mapping[str, str]) -> tuple[float, str]:
    """Frames per second, and how the rate is known."""
    declared = next((keywords[word] for word in _RATE_KEYWORDS if word in keywords), None)
    if declared is None:
        return RATE, f"the file states no frame rate: {RATE:g} Hz, the rate of the CMU library"
    try:
        rate = float(declared)
    except ValueError:
        rate = np.nan
    if not _RATES[0] <= rate <= _RATES[1]:
        raise source.error(expected=f"a rate of {_RATES[0]:g} to {_RATES[1]:g} Hz", found=repr(declared[:40]))
    return rate, f"{rate:g} Hz, as stated in the file"


def _later(source: Source, numbers: Array) -> tuple[NDArray[np.bool_], list[Defect]]:
    """The frames whose numbers increase."""
    if not numbers.max() <= _MAX_FRAME:
        raise source.error(expected="frame numbers of a recording", found=f"{numbers.max():g}")
    return increasing_times(numbers)


def _joints(text: AsfText) -> tuple[tuple[str, ...], tuple[int, ...], Array, Array]:
    """Names, parents, rests (J, 4) and offsets (J, 3) in the declared unit: bones first, then their free
    ends."""
    bones = text.bones
    names, parents = [bone.name for bone in bones], [bone.parent for bone in bones]
    parent_axes = [bones[bone.parent].axis if bone.parent >= 0 else IDENTITY for bone in bones]
    rests = [multiply(conjugate(axis), bone.axis) for axis, bone in zip(parent_axes, bones, strict=True)]
    ends = [rotate(conjugate(bone.axis), bone.end) / text.length for bone in bones]
    offsets = [text.position / text.length, *(ends[parent] for parent in parents[1:])]
    for joint, bone in enumerate(bones):
        if joint not in parents and ends[joint].any():
            names.append(f"{bone.name}_end")
            parents.append(joint)
            rests.append(IDENTITY)
            offsets.append(ends[joint])
    return tuple(names), tuple(parents), np.array(rests), np.array(offsets)


def _channels(
    text: AsfText, values: Mapping[str, Array], joints: int, degrees: bool
) -> tuple[tuple[str, ...], Array, Array]:
    """Intrinsic orders (J,), angles (T, J, 3) in radians, and the root's position (T, 3) in the declared
    unit."""
    frames = len(next(iter(values.values())))
    euler, root = np.zeros((frames, joints, 3)), np.zeros((frames, 3))
    orders = [""] * joints
    for joint, bone in enumerate(text.bones):
        for k in reversed(range(len(bone.dofs))):
            kind, axis = bone.dofs[k][:1], bone.dofs[k][1:].upper()
            column = values[bone.name][:, k]
            if kind == "t" and joint == 0:
                root[:, "XYZ".index(axis)] = column / text.length
            elif kind == "r":
                euler[:, joint, len(orders[joint])] = column
                orders[joint] += axis
        # Axes that a bone lacks are zero, at the end of its order.
        orders[joint] += "".join(axis for axis in "XYZ" if orders[joint] and axis not in orders[joint])
    return (
        tuple(orders),
        np.radians(euler, out=euler) if degrees else euler,
        root + text.position / text.length,
    )


def _not_read(text: AsfText) -> list[str]:
    """A note if bones move against their parents or vary in length, which is not read."""
    moving = [bone.name for bone in text.bones[1:] if not set(bone.dofs) <= set(ROTATIONS)]
    if not moving:
        return []
    return [f"translations and lengths of bones are not read ({listed(moving)})"]


def _knees(text: AsfText, values: Mapping[str, Array], degrees: bool) -> dict[str, Array]:
    """The file's own knee curves: if a shin has one angle, it is the knee's flexion, in every library."""
    hinges = {bone.name for bone in text.bones if bone.dofs == ("rx",)}
    return {
        knee: np.radians(values[shin][:, 0]) if degrees else values[shin][:, 0].copy()
        for knee, shin in _KNEES.items()
        if shin in hinges
    }
