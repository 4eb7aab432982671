"""A scenario from its TOML file (docs/scenarios.md), or a shipped one by name."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Generic, TypeAlias, TypeVar

from msgspec import Meta, Struct

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.pipeline.files.validation.bounded import MEGABYTE
from kinemimic.pipeline.files.validation.records import RecordError, convert, one_of
from kinemimic.pipeline.files.validation.toml_file import parse_toml, read_text
from kinemimic.retarget.humanoid.body import BODY_NAMES
from kinemimic.train.scenario.scenario import Load, Placement, Range, Scenario
from kinemimic.train.sim.world import CONTROL_RATE, Shape

SHIPPED = DATASETS / "scenarios"
MAX_BYTES = MEGABYTE
MAX_ITEMS = 200  # of forces, torques and obstacles each
MIN_LENGTH, MIN_RADIUS = 0.1, 0.5  # m, of a part of a route and of its radius

T = TypeVar("T")


def _row(value: Any) -> tuple[float, ...]:
    return value if isinstance(value, tuple) else (value,)


class _FromTo(
    Struct, Generic[T], frozen=True, forbid_unknown_fields=True, rename={"low": "from", "high": "to"}
):
    low: T
    high: T

    def __post_init__(self) -> None:
        low, high = _row(self.low), _row(self.high)
        if len(low) != len(high) or any(b < a for a, b in zip(low, high, strict=True)):
            found = f"from {self.low} to {self.high}"
            raise RecordError(expected="numbers in `from` that are not above those in `to`", found=found)


def _range(value: Any, scale: float = 1.0) -> Range:
    """The range of a value or range in the file."""
    low, high = (value.low, value.high) if isinstance(value, _FromTo) else (value, value)
    return Range(tuple(scale * v for v in _row(low)), tuple(scale * v for v in _row(high)))


# A value, or the range that it is drawn from.
_Drawn: TypeAlias = T | _FromTo[T]
_Turn = Annotated[float, Meta(ge=-360.0, le=360.0)]  # degrees
_Length = Annotated[float, Meta(ge=0.0, le=1000.0)]  # m, of a part of a route
_Seconds = _Drawn[Annotated[float, Meta(ge=0.0, le=600.0)]]
_Size = Annotated[float, Meta(ge=1e-2, le=100.0)]
_Position = Annotated[
    tuple[Annotated[float, Meta(ge=-100.0, le=100.0)], ...],
    Meta(min_length=2, max_length=3, description="2 or 3 numbers from -100 to 100"),
]
_Load3 = Annotated[float, Meta(ge=-1e4, le=1e4)]
_Loads = _Drawn[tuple[_Load3, _Load3, _Load3]]
_Speed = Annotated[float, Meta(ge=-50.0, le=50.0)]
_Speeds = _Drawn[tuple[_Speed, _Speed, _Speed]]
_Items = Meta(max_length=MAX_ITEMS)


class _Ground(Struct, frozen=True, forbid_unknown_fields=True):
    friction: _Drawn[Annotated[float, Meta(ge=0.0, le=2.0)]] | None = None
    slope: _Drawn[Annotated[float, Meta(ge=-45.0, le=45.0)]] = 0.0


class _Load(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    body: Annotated[str, one_of(BODY_NAMES)]
    at: _Seconds = 0.0
    lasts: _Drawn[Annotated[float, Meta(ge=1e-3, le=600.0)]] = 0.2
    growing: bool = False

    def load(self, **size: Range) -> Load:
        return Load(self.body, _range(self.at), _range(self.lasts), growing=self.growing, **size)


class _Force(_Load, frozen=True, forbid_unknown_fields=True, kw_only=True):
    newton: _Loads


class _Torque(_Load, frozen=True, forbid_unknown_fields=True, kw_only=True):
    newton_metres: _Loads


class _Obstacle(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    shape: Shape
    size: _Drawn[_Size | tuple[_Size, ...]]
    position: _Drawn[_Position]
    turn: _Drawn[_Turn] = 0.0
    mass: _Drawn[Annotated[float, Meta(ge=0.0, le=1e4)]] = 0.0
    at: _Seconds = 0.0
    velocity: _Speeds = (0.0, 0.0, 0.0)
    spin: _Speeds = (0.0, 0.0, 0.0)
    count: Annotated[int, Meta(ge=1, le=MAX_ITEMS)] = 1

    def __post_init__(self) -> None:
        wanted = {"sphere": 1, "cylinder": 2, "box": 3}[self.shape]
        if len(_range(self.size).low) != wanted:
            expected = f"{f'{wanted} numbers' if wanted > 1 else 'a number'} from 0.01 to 100"
            raise RecordError("size", expected=expected, found=f"{self.size}")
        placement = self.placement
        lowest, half = placement.position.low, 0.5 * (placement.size.high[0 if wanted == 1 else 2])
        if len(lowest) == 3 and lowest[2] < half:
            expected = f"its centre at {half:g} m or above, half its height"
            raise RecordError("position", expected=expected, found=f"{lowest[2]:g}")
        moves = (placement.velocity, placement.spin)
        if placement.mass.low[0] <= 0.0 and any(any((*one.low, *one.high)) for one in moves):
            expected = "more than 0 kg for an obstacle with a velocity or a spin"
            raise RecordError("mass", expected=expected, found="0")

    @property
    def placement(self) -> Placement:
        size = _range(self.size)
        if self.shape == "sphere":
            size = Range(size.low * 3, size.high * 3)
        elif self.shape == "cylinder":
            size = Range((size.low[0], *size.low), (size.high[0], *size.high))
        keys = ("position", "mass", "at", "velocity", "spin")
        drawn = {key: _range(getattr(self, key)) for key in keys}
        return Placement(shape=self.shape, size=size, turn=_range(self.turn, math.radians(1.0)), **drawn)


class _File(Struct, frozen=True, forbid_unknown_fields=True):
    about: str = ""
    seconds: Annotated[float, Meta(ge=0.1, le=600.0)] = 10.0
    phase: _Drawn[Annotated[float, Meta(ge=0.0, le=1.0)]] = _FromTo(0.0, 1.0)
    route: Annotated[tuple[tuple[_Length, _Turn], ...], _Items] = ()  # (m, degrees to the left)
    ground: _Ground = _Ground()
    force: Annotated[tuple[_Force, ...], _Items] = ()
    torque: Annotated[tuple[_Torque, ...], _Items] = ()
    obstacle: Annotated[tuple[_Obstacle, ...], _Items] = ()

    def __post_init__(self) -> None:
        for index, (length, turn) in enumerate(self.route):
            if length < max(MIN_LENGTH, MIN_RADIUS * abs(math.radians(turn))):
                expected = (
                    f"lengths of {MIN_LENGTH} m or more, and bends of a radius of {MIN_RADIUS} m or more"
                )
                raise RecordError("route", index, expected=expected, found=f"[{length:g}, {turn:g}]")
        latest = self.seconds - 1.0 / CONTROL_RATE
        for key in ("force", "torque", "obstacle"):
            for index, item in enumerate(getattr(self, key)):
                if (at := _range(item.at).high[0]) > latest:
                    expected = f"a number from 0 to {latest:g}"
                    raise RecordError(key, index, "at", expected=expected, found=f"{at}")
        if (count := sum(item.count for item in self.obstacle)) > MAX_ITEMS:
            raise RecordError("obstacle", expected=f"at most {MAX_ITEMS} in all", found=f"{count}")
        sloped = any(_range(self.ground.slope).low + _range(self.ground.slope).high)
        if sloped and self.route:
            expected = "0 on a route, which changes its direction"
            raise RecordError("ground", "slope", expected=expected, found="a slope")
        if sloped and any(_range(item.mass).high[0] > 0 for item in self.obstacle):
            expected = "0 where an obstacle can move"
            raise RecordError("ground", "slope", expected=expected, found="a slope", advice="give it mass 0")


def find_scenario(named: str) -> Scenario:
    """A shipped scenario by name, or one from a file by path (with a "/" or ending in ".toml").

    KinemimicError, in one line, names the shipped scenarios, or the key of the first mistake.
    """
    path = Path(named)
    if path.suffix == ".toml" or len(path.parts) > 1:
        return read_scenario(path)
    shipped = shipped_scenarios()
    if named not in shipped:
        raise KinemimicError(
            f"expected a shipped scenario ({', '.join(shipped)}) or a file ending in .toml, found {named!r}"
        )
    return read_scenario(SHIPPED / f"{named}.toml")


def shipped_scenarios() -> tuple[str, ...]:
    """Names of the shipped scenarios."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.toml")))


def read_scenario(path: Path) -> Scenario:
    """The scenario of a file, named after it."""
    file = convert(parse_toml(path, read_text(path, MAX_BYTES, "a scenario")), _File, path)
    ground = file.ground
    return Scenario(
        name=path.stem,
        about=file.about,
        seconds=file.seconds,
        phase=_range(file.phase),
        friction=None if ground.friction is None else _range(ground.friction),
        slope=_range(ground.slope, math.radians(1.0)),
        route=tuple((length, math.radians(turn)) for length, turn in file.route),
        loads=(
            *(item.load(force=_range(item.newton)) for item in file.force),
            *(item.load(torque=_range(item.newton_metres)) for item in file.torque),
        ),
        obstacles=tuple(item.placement for item in file.obstacle for _ in range(item.count)),
    )
