"""What a walk is compared with: adults and children, in the form of a subject of gait_report.json.

A row of a table then reads them as it reads the run's own subjects.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.cli.palette import light
from kinemimic.pipeline.gait import adults, normative
from kinemimic.pipeline.gait.curves import CYCLE
from kinemimic.pipeline.kinematics.skeleton import SIDES

Json = Mapping[str, Any]


@dataclass(frozen=True)
class Norm:
    """band: joint and phases -> mean and standard deviation in radians; subject: what gait_report.json has of
    a subject, as far as it is known; style: of the band."""

    name: str
    source: str
    band: Callable[[str, Array], tuple[Array, Array]]
    subject: Json
    style: Mapping[str, Any]

    def limits(self, joint: str) -> tuple[Array, Array]:
        """Mean minus and plus one standard deviation (101,) in degrees."""
        mean, spread = (np.degrees(values) for values in self.band(joint, CYCLE))
        return mean - spread, mean + spread


def _spread(pair: tuple[float, float]) -> Json:
    return dict(zip(("mean", "sd"), pair, strict=True))


def _sides(value: Json) -> Json:
    """A value of both sides together, which holds for each."""
    return dict.fromkeys(("both", *SIDES), value)


def _adults() -> Json:
    return {
        "strides": f"{adults.STRIDES} ({adults.SUBJECTS} people)",
        "parameters": {name: _sides(_spread(pair)) for name, pair in adults.PARAMETERS.items()},
        "normalised": {name: _spread(pair) for name, pair in adults.NORMALISED.items()},
        "curves": {
            f"{joint}_{side}": {"range_deg": _spread(pair)}
            for joint, pair in adults.RANGES_DEG.items()
            for side in SIDES
        },
    }


def _children() -> Json:
    """The ranges are those of the mean curves: the tables do not have each child's."""
    ranges = {
        joint: float(np.ptp(np.degrees(normative.normative_band(joint, CYCLE)[0])))
        for joint in normative.NORMATIVE_JOINTS
    }
    return {
        "strides": f"{normative.SUBJECTS} people",
        "parameters": {"stance_ratio": _sides({"mean": normative.FOOT_OFF, "sd": None})},
        "normalised": {"speed": "{} to {}".format(*normative.FREE_SPEED)},
        "curves": {
            f"{joint}_{side}": {"range_deg": value} for joint, value in ranges.items() for side in SIDES
        },
    }


NORMS: tuple[Norm, ...] = (
    Norm("adults", adults.SOURCE, adults.adult_band, _adults(), {"color": light("green"), "alpha": 0.25}),
    Norm("children", normative.SOURCE, normative.normative_band, _children(), {"color": light("band")}),
)
