"""The unit of a body's path where the body itself has no lengths: metres, or else centimetres or millimetres.

Rotations turn a body of known size, so that nothing but the path itself can tell that it is in another unit
than the format's: it is too fast for a person, or the pelvis is a hundred legs above the ground.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER, UNITS, Unit

_OTHERS: dict[str, str] = {"cm": "centimetres", "mm": "millimetres"}
# In m/s over a tenth of a second: sprinters reach 12.
_FASTEST, _INTERVAL = 15.0, 0.1
# How much the pelvis' height over the file's origin may differ from that over the feet: bent knees, a floor
# that is not quite at zero.
_HEIGHT_TOLERANCE = 0.2


def path_unit(path: Array, feet: Array, rate: float, named: str | None = None) -> Unit:
    """The unit of a path, with a defect if it is not metres.

    path: (T, 3) of the pelvis, Z up; feet: (T, 2, 3) relative to the pelvis in metres; rate: Hz; named: the
    user's unit, a key of UNITS. Of centimetres and millimetres, it is the one in which the planted foot moves
    less.
    """
    if named is not None:
        return Unit(UNITS[named], named, SET_BY_USER, [])
    step = max(1, round(_INTERVAL * rate))
    ways, of_feet = path[step:] - path[:-step], feet[step:] - feet[:-step]
    still = not len(ways)
    speed = 0.0 if still else float(np.percentile(np.linalg.norm(ways, axis=-1), 95.0)) * rate / step

    def slide(unit: str) -> float:
        moved = np.linalg.norm(UNITS[unit] * ways[:, None] + of_feet, axis=-1)
        return 0.0 if still else float(np.median(moved.min(axis=1)))

    if speed > _FASTEST:
        unit = min(_OTHERS, key=slide)
        if speed * UNITS[unit] <= _FASTEST:
            return _other(unit, len(path), f"in metres the body would move at {speed:.0f} m/s")
    height, leg = float(np.median(path[:, 2])), float(np.median(-feet[..., 2].min(axis=1)))
    for unit in _OTHERS:
        fits = abs(height * UNITS[unit] - leg) < _HEIGHT_TOLERANCE * leg
        if fits and slide(unit) <= slide("m"):
            return _other(unit, len(path), f"in metres the pelvis would be {height:.0f} m high")
    return Unit(1.0, "m", "the format's", [])


def _other(unit: str, frames: int, why: str) -> Unit:
    text = f"the path is in {_OTHERS[unit]}: {why}; converted"
    defect = Defect("wrong_units", frames, "frames", "repaired", text)
    return Unit(UNITS[unit], unit, "a person's speed and height", [defect])
