"""Write the `.skl` text of a real Kinect v1 recorder (its variant with 85 or 86 columns)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.store import write_text
from kinemimic.pipeline.kinematics.rotations import Y_UP_TO_Z_UP, conjugate, rotate
from kinemimic.pipeline.kinematics.skeleton import MISSING
from kinemimic.pipeline.readers.kinect.nui_skl import KINECT_V1_JOINTS
from kinemimic.pipeline.readers.kinect.skl_text import FIELDS


def write_skl(
    path: Path,
    milliseconds: NDArray[np.int64],
    positions: Array,
    states: NDArray[np.uint8],
    floor_plane: Array,
    *,
    frame_numbers: NDArray[np.int64] | None = None,
) -> None:
    """Write T frames of the 20 joints.

    milliseconds: (T,) on the sensor's clock; positions: (T, 20, 3) metres in our world, above the floor;
    states: (T, 20); floor_plane: (4,) of the floor in the sensor's frame; frame_numbers: (T,) adds that
    column. A lost joint is written as the recorder does: state 0, at the sensor's position above the floor.
    """
    joints = rotate(conjugate(Y_UP_TO_Z_UP), positions)
    joints[states == MISSING] = [0.0, floor_plane[3], 0.0]
    header = ["timestamp"]
    if frame_numbers is not None:
        header.append("framenum")
    header += [f"{joint}_{field}" for joint in KINECT_V1_JOINTS for field in FIELDS]
    header += [f"FloorPlane_{letter}" for letter in "ABCD"]
    plane = [_number(value) for value in floor_plane]
    lines = ["\t".join(header)]
    for frame, time in enumerate(milliseconds):
        words = [str(int(time))]
        if frame_numbers is not None:
            words.append(str(int(frame_numbers[frame])))
        for joint, state in zip(joints[frame], states[frame], strict=True):
            words += [*(_number(value) for value in joint), str(int(state))]
        lines.append("\t".join(words + plane))
    write_text(path, "".join(line + "\r\n" for line in lines))


def _number(value: float) -> str:
    """Fifteen digits, as .NET formats a double."""
    return f"{value:.15g}"
