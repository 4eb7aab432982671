"""Scenarios: forces, torques, obstacles and the ground during a rollout, as data.

A scenario consists of ranges; `event_schedule.py` draws the events of one trial from them. Vectors and
positions are (ahead, left, up) relative to the reference's heading at that time, in metres, newtons and
newton metres; times are seconds from the start. `scenario_file.py` reads a scenario from TOML.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.files.validation.records import RecordError
from kinemimic.retarget.humanoid.body import BODY_NAMES
from kinemimic.train.sim.world import CONTROL_RATE, Shape


@dataclass(frozen=True)
class Range:
    """Numbers (n,) that a trial draws uniformly between `low` and `high`."""

    low: tuple[float, ...]
    high: tuple[float, ...]

    @classmethod
    def of(cls, *values: float) -> Range:
        """Constant values."""
        return cls(values, values)

    def draw(self, random: np.random.Generator) -> Array:
        """(n,)"""
        return random.uniform(self.low, self.high)


_ZERO, _NOWHERE = Range.of(0.0), Range.of(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Load:
    """A force N or a torque N·m (3,), or both, on one body at its centre of mass.

    at: s; lasts: s; growing: linearly from 0 to the full size at the end.
    """

    body: str
    at: Range
    lasts: Range
    force: Range = _NOWHERE
    torque: Range = _NOWHERE
    growing: bool = False

    def __post_init__(self) -> None:
        if self.body not in BODY_NAMES:
            raise RecordError("body", expected=f"one of {', '.join(BODY_NAMES)}", found=repr(self.body))


@dataclass(frozen=True)
class Placement:
    """An obstacle that stands on the ground or is thrown.

    size: outer dimensions (3,), m, as in `Obstacle`; position: (2,) on the ground or (3,) of its centre, m,
    relative to the point on the ground below the reference's root at that time; turn: rad about the vertical;
    mass: kg, 0 for a static obstacle; at: s, when it appears; velocity, spin: (3,) at that time, m/s and
    rad/s.
    """

    shape: Shape
    size: Range
    position: Range
    turn: Range = _ZERO
    mass: Range = _ZERO
    at: Range = _ZERO
    velocity: Range = _NOWHERE
    spin: Range = _NOWHERE


@dataclass(frozen=True)
class Scenario:
    """seconds: of a trial; phase: where in the reference it starts; friction: of the ground, None for the
    default; slope: rad, uphill along the heading; route: of a gait, segments (length in m, turn in rad to the
    left; `route.py`), empty for straight ahead. Obstacles that are there from the start of a route are placed
    relative to its origin."""

    name: str
    about: str = ""
    seconds: float = 10.0
    phase: Range = Range((0.0,), (1.0,))
    friction: Range | None = None
    slope: Range = _ZERO
    route: tuple[tuple[float, float], ...] = ()
    loads: tuple[Load, ...] = ()
    obstacles: tuple[Placement, ...] = ()

    @property
    def steps(self) -> int:
        """Control steps of a trial."""
        return round(self.seconds * CONTROL_RATE)

    def to_json(self) -> dict[str, Any]:
        """Its JSON values."""
        value: dict[str, Any] = json.loads(json.dumps(asdict(self)))
        return value
