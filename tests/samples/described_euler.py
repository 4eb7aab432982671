"""Euler angles in a table of the user's own, described in TOML; cells may be empty."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kinemimic.pipeline.kinematics.clip import Clip

_MISSING = tuple[int, str, int]  # frame, joint, channel


def write(folder: Path, clip: Clip, missing: frozenset[_MISSING] = frozenset()) -> Path:
    """walk.csv and walk.toml of a capture of Euler angles, with these cells empty.

    clip: as read from BVH, all of its joints with one order.
    """
    assert clip.euler is not None and clip.orders is not None and clip.translations is not None
    names, degrees = clip.skeleton.names, np.degrees(clip.euler)
    (order,) = set(clip.orders) - {""}
    rows = []
    for frame, time in enumerate(clip.times):
        cells = [f"{time:.6f}", *(f"{x:.9f}" for x in clip.translations[frame, 0])]
        cells += [
            "" if (frame, j, k) in missing else f"{degrees[frame, j, k]:.9f}"
            for j in range(len(names))
            for k in range(3)
        ]
        rows.append(",".join(cells))
    joints = []
    for j, (joint, parent) in enumerate(zip(names, clip.skeleton.parents, strict=True)):
        column = 5 + 3 * j
        place = "position = [2, 3, 4]" if parent < 0 else f"offset = {clip.skeleton.offsets[j].tolist()}"
        above = "" if parent < 0 else names[parent]
        euler = f", euler = [{column}, {column + 1}, {column + 2}]" if clip.orders[j] else ""
        joints.append(f'{joint} = {{ {place}, parent = "{above}"{euler} }}')
    head = f'kinemimic = 1\n[time]\ncolumn = 1\n[rotations]\norder = "{order}"\n[joints]\n'
    (folder / "walk.toml").write_text(head + "\n".join(joints) + "\n")
    path = folder / "walk.csv"
    path.write_text("\n".join(rows) + "\n")
    return path
