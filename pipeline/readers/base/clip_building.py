"""Build a clip from a reader's arrays, as every reader does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array, States
from kinemimic.pipeline.kinematics.clip import Clip, Label
from kinemimic.pipeline.kinematics.euler import positions_of_channels
from kinemimic.pipeline.kinematics.rotations import Y_UP_TO_Z_UP, to_matrix
from kinemimic.pipeline.kinematics.skeleton import MISSING, TRACKED, Skeleton
from kinemimic.pipeline.quality.rules.defect import Defect, sorted_defects
from kinemimic.pipeline.readers.base.format import Format


def reading(
    *, units: str, units_rule: str, defects: Sequence[Defect] = (), notes: Sequence[str] = (), **facts: Any
) -> dict[str, Any]:
    """The record in provenance["reading"], in JSON values: how the file was read and what was wrong with it.

    units: length unit of the file; units_rule: how it is known; notes: sentences for the user; facts: further
    entries of the format (columns, channels …).
    """
    return {
        "units": units,
        "units_rule": units_rule,
        "defects": [defect.to_json() for defect in sorted_defects(defects)],
        "notes": list(notes),
        **facts,
    }


def clip_of_points(
    skeleton: Skeleton,
    times: Array,
    points: Array,
    states: States | None,
    *,
    format: Format,
    reading: Mapping[str, Any],
    world_from_file: Array = Y_UP_TO_Z_UP,
    rotations: Array | None = None,
    angles: Mapping[str, Array] | None = None,
    labels: Sequence[Label] = (),
) -> Clip:
    """A clip of positions, in one pass.

    times: (T,) seconds, strictly increasing; points: (T, J, 3) metres in the file's axes; states: (T, J) of
    0, 1, 2, or None if the format has none: then every joint that is present counts as tracked. A joint that
    is not finite, or exactly at the sensor's origin, is missing. world_from_file: (4,) rotation from the
    file's axes to ours. rotations, angles, labels: as in Clip, already in our conventions.
    """
    x, y, z = np.moveaxis(points, -1, 0)
    # Written out per axis: numpy takes five times as long to reduce an axis of three.
    unseen = ~(np.isfinite(x) & np.isfinite(y) & np.isfinite(z)) | ((x == 0.0) & (y == 0.0) & (z == 0.0))
    if states is None:
        known = np.full(unseen.shape, TRACKED, dtype=np.uint8)
    else:
        known = states.astype(np.uint8)
        unseen |= known == MISSING
    positions = points
    if unseen.any():
        positions = points.copy()
        known[unseen], positions[unseen] = MISSING, np.nan
    return Clip(
        skeleton=skeleton,
        times=times,
        positions=positions @ to_matrix(world_from_file).T,
        states=known,
        passes=np.zeros(len(times), dtype=np.int32),
        world_from_file=np.asarray(world_from_file, dtype=np.float64).copy(),
        rotations=rotations,
        angles=angles,
        labels=tuple(labels),
        provenance={
            "format": format.name,
            "sensor": format.sensor,
            "reading": {**reading, **({"right_handed": True} if format.right_handed else {})},
        },
    )


def clip_of_channels(
    skeleton: Skeleton,
    times: Array,
    translations: Array,
    euler: Array,
    orders: tuple[str, ...],
    *,
    format: Format,
    reading: Mapping[str, Any],
    world_from_file: Array = Y_UP_TO_Z_UP,
    rests: Array | None = None,
    angles: Mapping[str, Array] | None = None,
) -> Clip:
    """A clip of Euler channels in one pass, every joint tracked; all arrays as in Clip."""
    return Clip(
        skeleton=skeleton,
        times=times,
        positions=positions_of_channels(skeleton, translations, euler, orders, world_from_file, rests),
        states=np.full(euler.shape[:2], TRACKED, dtype=np.uint8),
        passes=np.zeros(len(euler), dtype=np.int32),
        euler=euler,
        orders=orders,
        translations=translations,
        world_from_file=world_from_file.copy(),
        rests=rests,
        angles=angles,
        provenance={"format": format.name, "sensor": format.sensor, "reading": dict(reading)},
    )
