"""Joints without names: told by their number and by the body that they make, whatever file they come from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import infer_unit
from kinemimic.pipeline.readers.base.clip_building import clip_of_points, reading
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.frame_defects import refuse_remote, zero_frames
from kinemimic.pipeline.readers.base.node_parents import skeleton_of
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.video_clock import Rate, times_of_frames
from kinemimic.pipeline.readers.landmarks.blaze_pose import LANDMARKS, path_of_landmarks, states_of
from kinemimic.pipeline.readers.landmarks.joint_sets import joint_set_of, places

_PIXELS = 20.0  # larger than a person in metres


def clip_of_unnamed(
    points: Array,
    visibility: Array,
    source: Source,
    *,
    format: Format,
    beside: Mapping[str, Array],
    rate: Rate | None,
    defects: Sequence[Defect] = (),
) -> Clip:
    """The clip of the nodes that the joints give; every joint that is finite counts as tracked, unless it is
    hardly visible.

    points: (T, J, 3) in any unit; visibility: (T, J, 1 or 0), 0 to 1 or states; beside: name -> a number of
    each frame (T,), for the clock; rate: the one that the file states, if any; defects: of the file. Raises
    CaptureError for places in a picture, and for numbers that are no body in any known order.
    """
    if is_flat(points):
        raise source.error(
            expected="joints in three dimensions",
            found="places in a picture with a confidence (none is negative, none of the third above 1)",
            advice="lift them first, or give the video itself to `kinemimic ingest`",
        )
    joint_set = joint_set_of(points)
    if joint_set is None:
        raise source.error(
            expected=f"{points.shape[1]} joints in a known order, whose limbs keep their lengths",
            found="limbs that change their lengths, differ between left and right, or are no person's",
            advice="save it as CSV and describe its columns (`kinemimic inspect --suggest` drafts that)",
        )
    times = times_of_frames(
        len(points), beside, source, lambda frame: f"frame {frame}", rate=rate, usual=joint_set.rate
    )
    notes = [f"{joint_set.name}: told by their number and the lengths of the limbs", times.note]
    shown = places(points, joint_set)
    # A pelvis at the origin of every frame is where the others are counted from: no measurement.
    if "hip_center" in shown and not shown["hip_center"].any():
        del shown["hip_center"]
    nodes = tuple(node for node in NODES if node in shown)
    skeleton = skeleton_of(nodes)
    at = np.stack([shown[node] for node in nodes], axis=1)
    parents = [node if parent < 0 else parent for node, parent in enumerate(skeleton.parents)]
    with np.errstate(over="ignore", invalid="ignore"):  # a damaged file may hold any number
        bones = _whole(at - at[:, parents])
        unit = infer_unit(nodes, skeleton.parents, bones, source.path, named=source.unit)
    refuse_remote(points * unit.metres, joint_set.joints, source, unit=unit.name)
    if joint_set.joints == LANDMARKS:
        told = source.unit is None and unit.name != "m"
        notes.append(path_of_landmarks(points * unit.metres, source, told=told))
    states = None
    if visibility.size:
        own = [joint_set.nodes[node] for node in nodes]
        sure = _as_shares(visibility[..., 0])
        states = np.stack([states_of(points[:, k], sure[:, k]) for k in own], axis=1)[times.kept]
    return clip_of_points(
        skeleton,
        times.seconds,
        at[times.kept] * unit.metres,
        states,
        format=format,
        reading=reading(
            units=unit.name,
            units_rule=unit.rule,
            defects=[*unit.defects, *times.defects, *defects, *zero_frames(points[times.kept])],
            notes=notes,
        ),
        world_from_file=joint_set.world_from_file,
    )


def is_flat(points: Array) -> bool:
    """Whether (T, J, 3) are x and y in a picture, in pixels or as shares of it, and a confidence."""
    known = points[np.isfinite(points).all(axis=-1)]
    if not len(known) or (known < 0.0).any() or (known[:, 2] > 1.0).any():
        return False
    return bool((known[:, :2] <= 1.0).all() or np.percentile(known[:, :2], 95.0) > _PIXELS)


def _as_shares(sure: Array) -> Array:
    """How sure each joint is (T, J), from 0 to 1; of states, which reach 2, an inferred is below a half."""
    largest = float(np.nanmax(sure, initial=0.0))
    return sure / largest * 0.99 if largest > 1.0 else sure


def _whole(offsets: Array) -> Array:
    """The frames in which every joint is seen; all frames if there is none."""
    whole = np.isfinite(offsets).all(axis=(1, 2)) & offsets.any(axis=(1, 2))
    return offsets[whole] if whole.any() else offsets
