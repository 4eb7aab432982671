"""Obstacles in the way of training episodes: boxes and cylinders of many sizes and masses."""

from __future__ import annotations

import math

from kinemimic.train.scenario.scenario import Placement, Range, Scenario

_IN_THE_WAY = Range((1.2, -0.45), (9.5, 0.45))  # as far as a walk comes in an episode
_MASS = Range((0.5,), (5.0,))

CLUTTER = Scenario(
    name="clutter",
    about="Light boxes and cylinders up to 1 m high in the way of training episodes.",
    obstacles=(
        Placement(
            "box",
            size=Range((0.2, 0.2, 0.2), (0.4, 0.4, 0.6)),
            position=_IN_THE_WAY,
            turn=Range((0.0,), (0.5 * math.pi,)),
            mass=_MASS,
        ),
    )
    * 5
    + (
        Placement(
            "cylinder",
            # A cylinder's second number is not used.
            size=Range((0.2, 0.2, 0.3), (0.4, 0.4, 1.0)),
            position=_IN_THE_WAY,
            mass=_MASS,
        ),
    )
    * 5,
)
