"""UI-PRMD's Kinect v2 recordings: local offsets of 22 joints and, in a second file, their Euler angles.

Both files have 66 comma-separated numbers per line, x y z per joint, at 30 Hz and without header. The
positions are each joint's offset in its parent's frame, in cm; only the waist's is absolute. The angles are
local, in degrees, stored as (x, y, z), of the intrinsic order ZXY: R = Rz Rx Ry. That order is not published
(the data set's own viewer uses another): it is the only one of the six with which the feet of a squatting
person stay on the ground. Y is up, X to the subject's left.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import Skeleton
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.readers.base.clip_building import clip_of_channels, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote
from kinemimic.pipeline.readers.base.numbers import Table, parse_table
from kinemimic.pipeline.readers.base.paired_files import required_half
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.public_datasets.uiprmd_table import head_of_numbers, triplets

RATE = 30.0
ORDER = "ZXY"
# Joint and its parent, in the file's order.
_TREE: tuple[tuple[str, str], ...] = (
    ("Waist", ""),
    ("Spine", "Waist"),
    ("Chest", "Spine"),
    ("Neck", "Chest"),
    ("Head", "Neck"),
    ("HeadTip", "Head"),
    ("LCollar", "Chest"),
    ("LUpperArm", "LCollar"),
    ("LForearm", "LUpperArm"),
    ("LHand", "LForearm"),
    ("RCollar", "Chest"),
    ("RUpperArm", "RCollar"),
    ("RForearm", "RUpperArm"),
    ("RHand", "RForearm"),
    ("LUpperLeg", "Waist"),
    ("LLowerLeg", "LUpperLeg"),
    ("LFoot", "LLowerLeg"),
    ("LToes", "LFoot"),
    ("RUpperLeg", "Waist"),
    ("RLowerLeg", "RUpperLeg"),
    ("RFoot", "RLowerLeg"),
    ("RToes", "RFoot"),
)
UIPRMD_JOINTS: tuple[str, ...] = tuple(name for name, _ in _TREE)
PARENTS: tuple[int, ...] = tuple(UIPRMD_JOINTS.index(parent) if parent else -1 for _, parent in _TREE)
WIDTH = 3 * len(UIPRMD_JOINTS)

FORMAT = Format(
    name="UI-PRMD Kinect",
    sensor="Kinect v2",
    holds="local offsets of 22 joints with Euler angles",
    recognised_by="66 numbers per line, with knees and ankles straight below their parents",
    columns=(WIDTH,),
    sidecar_file="the angles of the same recording: the same name with `angles` for `positions`",
)
# In a file of offsets, knees and ankles lie exactly on their parent's -Y axis; angles never look like that.
_LEGS = [UIPRMD_JOINTS.index(name) for name in ("LLowerLeg", "LFoot", "RLowerLeg", "RFoot")]
# The ends of the limbs have no angles.
_TIPS = [UIPRMD_JOINTS.index(name) for name in ("HeadTip", "LToes", "RToes")]
_AXIS_TOLERANCE, _BONE_LENGTHS = 0.01, (10.0, 80.0)
# Larger angles are damage.
_MAX_DEGREES = 3600.0
_CM = 0.01


def recognises(source: Source) -> bool:
    """True for 66 comma-separated numbers per line that are one of the two files."""
    head = head_of_numbers(source, WIDTH)
    return head is not None and (_are_positions(head) or _are_angles(head))


def read(source: Source) -> Clip:
    """The clip of the 22 joints with their Euler angles; both files of a pair give the same clip.

    A line of zeros is a frame in which nobody was seen; it is dropped and reported. Raises CaptureError if
    the other file is missing or does not match.
    """
    own_table = parse_table(source, width=WIDTH, separator=",")
    has_positions = _are_positions(triplets(own_table))
    halves = ("positions", "angles") if has_positions else ("angles", "positions")
    other = required_half(source, *halves)
    other_table = parse_table(other, width=WIDTH, separator=",")
    if _are_positions(triplets(other_table)) == has_positions:
        raise source.error(
            expected=f"positions in one and angles in the other of this file and {other.path.name}",
            found=f"{halves[0]} in both",
        )
    if len(own_table.values) != len(other_table.values):
        raise source.error(
            expected=f"as many frames as in {other.path.name}, {len(other_table.values)}",
            found=f"{len(own_table.values)}",
            advice="one of the two is cut off",
        )
    positions, angles = (own_table, other_table) if has_positions else (other_table, own_table)
    offsets, degrees = triplets(positions), triplets(angles)
    _refuse_damage(positions, angles)
    seen = offsets.any(axis=(1, 2))
    if not seen.any():
        raise positions.source.error(expected="a person in some frame", found="zeros only")
    offsets = offsets[seen] * _CM
    rest = np.median(offsets, axis=0)
    rest[0] = 0.0
    skeleton = Skeleton(UIPRMD_JOINTS, PARENTS, rest)
    euler = np.radians(degrees[seen])[..., ["XYZ".index(axis) for axis in ORDER]]
    return clip_of_channels(
        skeleton,
        np.flatnonzero(seen) / RATE,
        offsets,
        euler,
        (ORDER,) * len(UIPRMD_JOINTS),
        format=FORMAT,
        reading=reading(
            units="cm",
            units_rule="the format's",
            defects=_zero_lines(int((~seen).sum())),
            notes=[f"{RATE:g} Hz and Euler order {ORDER}: the format's, not stated in the files"],
            columns=WIDTH,
        ),
    )


def _are_positions(values: Array) -> bool:
    """Whether (T, 22, 3) are offsets: knees and ankles straight below, in most frames."""
    legs = values[:, _LEGS]
    below = (legs[..., 1] < -_BONE_LENGTHS[0]) & (legs[..., 1] > -_BONE_LENGTHS[1])
    straight = (np.abs(legs[..., [0, 2]]) < _AXIS_TOLERANCE).all(axis=-1)
    return bool((below & straight).all(axis=1).mean() > 0.5)


def _are_angles(values: Array) -> bool:
    """Whether (T, 22, 3) are angles: none at the ends of the limbs, in most frames."""
    tips = np.abs(values[:, _TIPS]).max(axis=(1, 2)) < _AXIS_TOLERANCE
    return bool(tips.mean() > 0.5 and values.any())


def _refuse_damage(positions: Table, angles: Table) -> None:
    """Raise CaptureError for numbers that are not finite, remote offsets or too large angles: forward
    kinematics needs every joint.
    """
    offsets, degrees = triplets(positions), triplets(angles)
    for values, table in ((offsets, positions), (degrees, angles)):
        if not np.isfinite(values).all():
            frame, joint, axis = (int(k) for k in np.argwhere(~np.isfinite(values))[0])
            raise table.source.error(
                expected="a finite number",
                found=f"{values[frame, joint, axis]:g} in {UIPRMD_JOINTS[joint]}",
                line=table.line(frame),
            )
    refuse_remote(offsets * _CM, UIPRMD_JOINTS, positions.source, positions.where, unit="cm")
    if np.abs(degrees).max() > _MAX_DEGREES:
        frame, joint, _ = (int(k) for k in np.argwhere(np.abs(degrees) > _MAX_DEGREES)[0])
        raise angles.source.error(
            expected=f"degrees, at most {_MAX_DEGREES:g}, in {UIPRMD_JOINTS[joint]}",
            found=f"{np.abs(degrees[frame, joint]).max():g}",
            line=angles.line(frame),
        )


def _zero_lines(count: int) -> list[Defect]:
    text = f"{count} lines of zeros only, left out"
    return [Defect("zero_frames", count, "frames", "repaired", text)] if count else []
