"""Joint arrays: numbers of shape (frames, joints, 3) in an .npy file, or in an .npz archive.

Networks that lift videos to three dimensions (VideoPose3D, MMPose), data sets and programs that generate
motion (HumanML3D) store joints like this. The array names neither its joints nor its unit, axes or rate:
the joints are those of the set in which they make a body (`joint_sets.py`), the unit follows from the legs,
and the rate is the set's usual one unless --rate states another.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.quality.rules.length_units import infer_unit
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote, zero_frames
from kinemimic.pipeline.readers.base.node_parents import skeleton_of
from kinemimic.pipeline.readers.base.npz import array_shapes, read_array
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.landmarks.blaze_pose import LANDMARKS, path_of_landmarks
from kinemimic.pipeline.readers.landmarks.joint_sets import COUNTS, joint_set_of, places

FORMAT = Format(
    name="joint array",
    sensor="unknown, often a video",
    holds=f"positions of {', '.join(map(str, sorted(COUNTS)[:-1]))} or {max(COUNTS)} joints",
    recognised_by="an .npy file, or an .npz archive with one array, of shape (frames, joints, 3)",
    binary=True,
)


def recognises(source: Source) -> bool:
    """True if there is one array of a number of joints that is known."""
    return _name(source) is not None


def read(source: Source) -> Clip:
    """The clip of the nodes that the joints give; every joint that is finite counts as tracked.

    Raises CaptureError for a damaged file, and for numbers that are no body in any known order.
    """
    name = _name(source)
    assert name is not None  # noqa: S101 (recognises() holds)
    values = read_array(source, name)
    if values.dtype.kind not in "fiu":
        raise source.error(expected="an array of numbers", found=f"one of {values.dtype}")
    with np.errstate(invalid="ignore"):  # a damaged file may hold any number
        points = values.reshape(-1, *values.shape[-2:]).astype(np.float64)
    if _is_flat(points):
        raise source.error(
            expected="joints in three dimensions",
            found="places in a picture with a confidence (none is negative, none of the third above 1)",
            advice="lift them first, or give the video itself to `kinemimic ingest`",
        )
    joint_set = joint_set_of(points)
    if joint_set is None:
        raise source.error(
            expected=f"{points.shape[1]} joints in a known order, whose limbs keep their lengths",
            found="limbs that change their lengths, or differ between left and right",
            advice="save it as CSV and describe its columns (`kinemimic inspect --suggest` drafts that)",
        )
    notes = [
        f"{joint_set.name}: told by their number and the lengths of the limbs",
        f"no time in the file: {joint_set.rate:g} Hz, unless --rate says what it has",
    ]
    shown = places(points, joint_set)
    # A pelvis at the origin of every frame is where the others are counted from: no measurement.
    if "hip_center" in shown and not shown["hip_center"].any():
        del shown["hip_center"]
    nodes = tuple(node for node in NODES if node in shown)
    skeleton = skeleton_of(nodes)
    at = np.stack([shown[node] for node in nodes], axis=1)
    parents = [node if parent < 0 else parent for node, parent in enumerate(skeleton.parents)]
    unit = infer_unit(nodes, skeleton.parents, _whole(at - at[:, parents]), source.path, named=source.unit)
    refuse_remote(points * unit.metres, joint_set.joints, source, unit=unit.name)
    if joint_set.joints == LANDMARKS:
        notes.append(path_of_landmarks(points * unit.metres, source))
    return clip_of_points(
        skeleton,
        np.arange(len(points)) / joint_set.rate,
        at * unit.metres,
        None,
        format=FORMAT,
        reading=reading(
            units=unit.name,
            units_rule=unit.rule,
            defects=[*unit.defects, *zero_frames(points)],
            notes=notes,
        ),
        world_from_file=joint_set.world_from_file,
    )


def _is_flat(points: Array) -> bool:
    """Whether (T, J, 3) are x and y in a picture and a confidence."""
    known = points[np.isfinite(points).all(axis=-1)]
    return len(known) > 0 and bool((known >= 0.0).all() and (known[:, 2] <= 1.0).all())


def _whole(offsets: Array) -> Array:
    """The frames in which every joint is seen; all frames if there is none."""
    whole = np.isfinite(offsets).all(axis=(1, 2)) & offsets.any(axis=(1, 2))
    return offsets[whole] if whole.any() else offsets


def _name(source: Source) -> str | None:
    """The name of the one array of joints, None without one, or with several."""
    names = [name for name, shape in array_shapes(source).items() if _is_of_joints(shape)]
    return names[0] if len(names) == 1 else None


def _is_of_joints(shape: tuple[int, ...]) -> bool:
    """Whether it is (T, J, 3), with one more axis of a single person at most."""
    if len(shape) not in (3, 4) or shape[-1] != 3 or shape[-2] not in COUNTS:
        return False
    *others, frames = sorted(shape[:-2])
    return frames > 1 and all(other == 1 for other in others)
