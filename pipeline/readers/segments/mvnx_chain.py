"""Positions of an MVNX file's segments from their orientations, where MVN exported no positions.

Each segment has the places of its joints in its own axes (`pos_b`). From the pelvis on, one segment's origin
follows from the one above. Where the pelvis was is not known: it stays where it is, and the feet reach the
ground.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.pipeline.kinematics.skeleton import Skeleton
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.segments.mvnx_text import Content

NOTE = (
    "no positions in the file: computed from the orientations and the segments' lengths; the pelvis stays in "
    "place"
)
_AXES = 3
# Metres of the lowest joint, usually a toe's, above the ground; a joint at the origin would count as missing.
_LOWEST = 0.02


def chain_positions(content: Content, skeleton: Skeleton, turns: Array, source: Source) -> Array:
    """Positions (T, J, 3) in metres of the segments' origins, Z up, the pelvis at rest.

    skeleton: of the J segments; turns: (T, J, 4) their orientations in the world. Raises CaptureError if the
    file does not say where on its segments some joint is.
    """
    positions = np.zeros((*turns.shape[:2], _AXES))
    joints = {joint.below: joint for joint in content.joints}
    for segment, (name, parent) in enumerate(zip(skeleton.names, skeleton.parents, strict=True)):
        if parent < 0:
            continue
        joint = joints[name]
        above, below = (
            content.points.get(place, [])
            for place in ((joint.above, joint.point_above), (name, joint.point_below))
        )
        if not (_is_place(above) and _is_place(below)):
            raise source.error(
                expected="<position> in the frames, or the places of the joints on the segments (<pos_b>)",
                found=f"neither at {joint.label[:40]!r}",
                advice="export the segments' positions from MVN, too",
            )
        there = positions[:, parent] + rotate(turns[:, parent], np.array(above))
        positions[:, segment] = there - rotate(turns[:, segment], np.array(below))
    positions[..., 2] += _LOWEST - positions[..., 2].min()
    return positions


def _is_place(numbers: list[float]) -> bool:
    return len(numbers) == _AXES and bool((np.abs(numbers) < 1.0).all())
