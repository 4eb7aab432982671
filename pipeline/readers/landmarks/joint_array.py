"""Joint arrays: numbers of shape (frames, joints, 3) in an .npy file, an .npz archive or a MAT-file.

A fourth number of each joint is its visibility, or its state. Joints may lie in a row, (frames, joints · 3),
or behind the axes, (frames, 3, joints), and frames come last in most MAT-files, (joints, 3, frames).

Networks that lift videos to three dimensions (VideoPose3D, MMPose), data sets and programs that generate
motion (HumanML3D) store joints like this. Of HumanML3D's vectors, joints are computed (`humanml3d.py`).

The array names neither its joints nor its unit, axes or rate: the joints are those of the set in which they
make a body (`joint_sets.py`), the unit follows from the legs, and the rate is the set's usual one unless
--rate states another, or other arrays of the archive: times or frame numbers of all frames ("timestamps"), or
a rate ("fps").
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers.array_files.array_file import array_shapes, read_arrays
from kinemimic.pipeline.readers.array_files.mat5 import is_mat5
from kinemimic.pipeline.readers.base.format import Format
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.clocks.clock import is_rate
from kinemimic.pipeline.readers.clocks.video_clock import Rate, stated_rate
from kinemimic.pipeline.readers.landmarks import humanml3d
from kinemimic.pipeline.readers.landmarks.joint_sets import COUNTS, FIELDS, FIELDS_OF_ROW, joint_set_of
from kinemimic.pipeline.readers.landmarks.unnamed_joints import clip_of_unnamed

FORMAT = Format(
    name="joint array",
    sensor="unknown, often a video",
    holds=f"positions of {', '.join(map(str, sorted(COUNTS)[:-1]))} or {max(COUNTS)} joints",
    recognised_by="an .npy file, or an .npz archive or MAT-file with one array, of shape (frames, joints, "
    "3), also with a visibility, or in a row, or HumanML3D's 263 or KIT-ML's 251 numbers",
    binary=True,
)
_MOST_AXES = 4
_WIDTHS = {*FIELDS_OF_ROW, *humanml3d.JOINTS}


def recognises(source: Source) -> bool:
    """True if there is one array of a number of joints that is known."""
    return _choice(source) is not None


def read(source: Source) -> Clip:
    """The clip of the nodes that the joints give; every joint that is finite counts as tracked, unless the
    array says that it is hardly visible.

    Raises CaptureError for a damaged file, and for numbers that are no body in any known order.
    """
    points, visibility = _numbers(source)
    beside, rate = _beside(len(points), source)
    return clip_of_unnamed(points, visibility, source, format=FORMAT, beside=beside, rate=rate)


def _numbers(source: Source) -> tuple[Array, Array]:
    """The points (T, J, 3) of the array, and how sure they are (T, J, 1 or 0): of the layouts that its shape
    allows, the first in which they make a body, else the first."""
    choice = _choice(source)
    assert choice is not None  # noqa: S101 (recognises() holds)
    name, ways = choice
    values = read_arrays(source, [name])[name]
    if values.dtype.kind not in "fiu":
        raise source.error(expected="an array of numbers", found=f"one of {values.dtype}")
    with np.errstate(invalid="ignore", over="ignore"):  # a damaged file may hold any number
        possible = [_by_joint(values.astype(np.float64), way) for way in ways]
    bodies = (numbers for numbers in possible if joint_set_of(numbers[..., :3]) is not None)
    numbers = possible[0] if len(possible) == 1 else next(bodies, possible[0])
    return numbers[..., :3], numbers[..., 3:]


def _beside(count: int, source: Source) -> tuple[dict[str, Array], Rate | None]:
    """Name -> a number of each frame, of the other arrays of the archive; and the rate that it states."""
    shapes = array_shapes(source)
    rate = next((name for name, shape in shapes.items() if is_rate(name) and math.prod(shape) == 1), None)
    of_frames = [name for name, shape in shapes.items() if shape in ((count,), (count, 1), (1, count))]
    arrays = read_arrays(source, [*of_frames, *([rate] if rate else [])])
    beside = {
        name: arrays[name].reshape(-1).astype(np.float64)
        for name in of_frames
        if name in arrays and arrays[name].dtype.kind in "fiu"
    }
    stated = None if rate is None else stated_rate(rate, arrays[rate].reshape(-1)[0].item(), source)
    return beside, stated


class _Way(NamedTuple):
    """How an array is laid out: the axes of frames, joints and a joint's numbers; joints: -1 if all numbers
    of a frame are in a row."""

    frames: int
    joints: int
    numbers: int


def _choice(source: Source) -> tuple[str, list[_Way]] | None:
    """The name of the one array of joints, and its possible layouts; None without one, or with several.

    Frames come first in numpy's files and mostly last in MATLAB's; another order counts where no array has
    the usual one. Rotations beside the joints are none.
    """
    shapes = array_shapes(source)
    ways = {name: found for name, shape in shapes.items() if (found := _ways(shape, rows=is_mat5(source)))}
    usual = -1 if is_mat5(source) else 0
    names = [name for name in ways if any(_place(shapes[name], way) == usual for way in ways[name])] or [
        *ways
    ]
    names = [name for name in names if any(_are_places(shapes[name], way) for way in ways[name])] or names
    if len(names) != 1:
        return None
    shape = shapes[names[0]]
    return names[0], sorted(ways[names[0]], key=lambda way: _place(shape, way) != usual)


def _are_places(shape: tuple[int, ...], way: _Way) -> bool:
    return way.joints >= 0 and shape[way.numbers] == 3


def _place(shape: tuple[int, ...], way: _Way) -> int:
    """0 if the frames are the first axis of more than one, -1 if they are the last, 1 in between."""
    many = [axis for axis, size in enumerate(shape) if size > 1]
    return {0: 0, len(many) - 1: -1}.get(many.index(way.frames), 1)


def _ways(shape: tuple[int, ...], *, rows: bool) -> list[_Way]:
    """The layouts that a shape allows; an axis of one person does not matter. rows: frames in a row may also
    be columns."""
    many = [axis for axis, size in enumerate(shape) if size > 1]
    if 0 in shape or len(shape) > _MOST_AXES:
        return []
    if len(many) == 2:
        orders = [(0, 1), (1, 0)] if rows else [(0, 1)]
        pairs = [(many[frames], many[numbers]) for frames, numbers in orders]
        return [
            _Way(frames, -1, numbers)
            for frames, numbers in pairs
            if shape[numbers] in _WIDTHS and shape[frames] not in FIELDS and shape[-1] > 1
        ]
    if len(many) != 3:
        return []
    ways = [_Way(*order) for order in itertools.permutations(many)]
    fitting = [way for way in ways if shape[way.joints] in COUNTS and shape[way.numbers] in FIELDS]
    # Three or four frames are rotations of joints, rather than a recording, unless they come first.
    return [way for way in fitting if way.frames == many[0] or shape[way.frames] not in FIELDS]


def _by_joint(values: Any, way: _Way) -> Any:
    """An array of such a layout as (T, J, 3 or 4)."""
    if way.joints >= 0:
        return np.moveaxis(values, way, (-3, -2, -1)).reshape([values.shape[axis] for axis in way])
    frames = np.moveaxis(values, (way.frames, way.numbers), (-2, -1)).reshape(values.shape[way.frames], -1)
    if frames.shape[1] in humanml3d.JOINTS:
        return humanml3d.joints_of(frames)
    return frames.reshape(len(frames), -1, FIELDS_OF_ROW[frames.shape[1]])
