"""Obstacles in the way of training episodes: boxes and cylinders of many sizes and masses."""

from __future__ import annotations

import math

from kinemimic.train.scenario.scenario import Placement, Range, Scenario

_IN_THE_WAY = Range((1.3, -0.45), (6.5, 0.45))
_MASS = Range((0.5,), (5.0,))

CLUTTER = Scenario(
    name="clutter",
    about="Light boxes and cylinders of up to hip height in the way of training episodes.",
    obstacles=(
        Placement(
            "box",
            size=Range((0.2, 0.2, 0.2), (0.4, 0.4, 0.6)),
            position=_IN_THE_WAY,
            turn=Range((0.0,), (0.5 * math.pi,)),
            mass=_MASS,
        ),
    )
    * 3
    + (
        Placement(
            "cylinder",
            # A cylinder's second number is not used.
            size=Range((0.2, 0.2, 0.3), (0.4, 0.4, 1.0)),
            position=_IN_THE_WAY,
            mass=_MASS,
        ),
    )
    * 3,
)
