"""The unit of a body's path where it may differ from that of the body.

Rotations turn a body of known size, so that nothing but the path itself can tell that it is in another unit:
it is too fast for a person, or the pelvis is a hundred legs above the ground, or a hundredth of one.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.quality.rules.defect import Defect
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER, UNITS, Unit

_OTHERS: dict[str, str] = {"cm": "centimetres", "mm": "millimetres"}
# In m/s over a tenth of a second: sprinters reach 12.
_FASTEST, _INTERVAL = 15.0, 0.1
# Share to which the way of a planted foot falls in another unit.
_CLEARER = 0.3
# How much the pelvis' height over the file's origin may differ from that over the feet: bent knees, a floor
# that is not quite at zero.
_HEIGHT_TOLERANCE = 0.2
# Factors by which the path of a body in any unit may be wrong: metres, centimetres and millimetres mixed.
MIXED = (0.001, 0.01, 0.1, 10.0, 100.0, 1000.0)


def path_unit(path: Array, feet: Array, rate: float, named: str | None = None) -> Unit:
    """The unit of a path, with a defect if it is not metres, but centimetres or millimetres.

    path, feet, rate: as for `path_factor`; named: the user's unit, a key of UNITS.
    """
    if named is not None:
        return Unit(UNITS[named], named, SET_BY_USER, [])
    units = {UNITS[name]: name for name in _OTHERS}
    factor, why = path_factor(path, feet, rate, units)
    if factor not in units:
        return Unit(1.0, "m", "the format's", [])
    text = f"the path is in {_OTHERS[units[factor]]}: in metres {why}; converted"
    defect = Defect("wrong_units", len(path), "frames", "repaired", text)
    return Unit(factor, units[factor], "a person's speed and height", [defect])


def path_factor(path: Array, feet: Array, rate: float, factors: Iterable[float]) -> tuple[float, str]:
    """The factor that makes a path one of this body, and what it would be without: 1 and nothing if it is.

    path: (T, 3) of the pelvis, Z up, in what should be metres; feet: (T, 2, 3) relative to the pelvis in
    metres; rate: Hz. Of several factors, it is the one with which the planted foot moves less.
    """
    step = max(1, round(_INTERVAL * rate))
    ways, of_feet = path[step:] - path[:-step], feet[step:] - feet[:-step]
    still = not len(ways)
    speed = 0.0 if still else float(np.percentile(np.linalg.norm(ways, axis=-1), 95.0)) * rate / step

    def slide(factor: float) -> float:
        moved = np.linalg.norm(factor * ways[:, None] + of_feet, axis=-1)
        return 0.0 if still else float(np.median(moved.min(axis=1)))

    slides = {factor: slide(factor) for factor in factors}
    if speed > _FASTEST:
        smaller = [
            factor
            for factor, moved in slides.items()
            if speed * factor <= _FASTEST and factor < 1.0 and moved < _CLEARER * slide(1.0)
        ]
        if smaller:
            return min(smaller, key=slides.__getitem__), f"the body would move at {speed:.0f} m/s"
    height, leg = float(np.median(path[:, 2])), float(np.median(-feet[..., 2].min(axis=1)))
    for factor, moved in slides.items():
        if abs(height * factor - leg) < _HEIGHT_TOLERANCE * leg and moved <= slide(1.0):
            return factor, f"the pelvis would be {height:.3g} m high"
    return 1.0, ""
