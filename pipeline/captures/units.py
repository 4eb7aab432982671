"""The length unit of a file that does not name it, from the size of the body in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.nodes import joints_of_nodes

Array = NDArray[np.float64]

# Units in use, in metres. "CMU" is the inch of the CMU library divided by the 0.45 of its skeleton files.
UNITS: dict[str, float] = {
    "m": 1.0,
    "CMU (0.056444 m)": 0.0254 / 0.45,
    "inch": 0.0254,
    "cm": 0.01,
    "mm": 0.001,
}
# Thigh plus shank of an adult; units differ by 2.2 or more, so children and giants are told apart too.
ADULT_LEG = 0.82
LEG_RANGE = (0.40, 1.20)
# Frames, spread over the recording, that are enough for a median.
_ENOUGH = 500


def metres_per_unit(names: tuple[str, ...], offsets: Array, path: Path) -> tuple[float, str]:
    """The unit that makes thigh plus shank the most like an adult's, by ratio: (metres, name).

    offsets: (T, J, 3) of each joint from its parent in the file's unit; T = 1 for a rigid skeleton.
    Raises CaptureError if the legs cannot be found by name or fit in no unit.
    """
    found = joints_of_nodes(names)
    wanted = [f"{joint}_{side}" for side in ("left", "right") for joint in ("knee", "ankle")]
    missing = [node for node in wanted if node not in found]
    if missing:
        raise CaptureError(
            path,
            expected="joints named as legs, from which the unit of length is told",
            found=f"no {', '.join(missing)} among {', '.join(names[:8])}{' …' if len(names) > 8 else ''}",
        )
    some = offsets[:: len(offsets) // _ENOUGH + 1]
    legs = [np.median(np.linalg.norm(some[:, found[node]], axis=-1)) for node in wanted]
    leg = float(sum(legs)) / 2.0
    if leg > 0:
        name = min(UNITS, key=lambda unit: abs(np.log(leg * UNITS[unit] / ADULT_LEG)))
        if LEG_RANGE[0] <= leg * UNITS[name] <= LEG_RANGE[1]:
            return UNITS[name], name
    raise CaptureError(
        path,
        expected=f"a leg of {LEG_RANGE[0]} to {LEG_RANGE[1]} m in one of {', '.join(UNITS)}",
        found=f"thigh plus shank of {leg:.4g} units",
    )
