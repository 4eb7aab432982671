"""A scenario from its TOML file (docs/scenarios.md), or one of those that ship, by name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.bounded import MEGABYTE, read_bounded
from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.pipeline.files.toml_keys import Keys, parse_toml
from kinemimic.retarget.humanoid.body import BODY_NAMES
from kinemimic.train.scenario.scenario import Load, Placement, Range, Scenario
from kinemimic.train.sim.world import CONTROL_RATE, Shape

SHIPPED = DATASETS / "scenarios"
MAX_BYTES = MEGABYTE
MAX_ITEMS = 200  # of forces, torques and obstacles each
MAX_SECONDS = 600.0
SHORTEST, TIGHTEST = 0.1, 0.5  # m, of a part of a route and of its radius
# Nothing more is meant in earnest: m, m/s, N and N·m, kg.
_LONG, _FAST, _STRONG, _HEAVY = 100.0, 50.0, 1e4, 1e4


def scenario(named: str) -> Scenario:
    """A scenario that ships, by its name, or one of a file, by its path (with a "/" or ending in ".toml").

    KinemimicError, in one line, names what there is, or the key of the first mistake.
    """
    path = Path(named)
    if path.suffix == ".toml" or len(path.parts) > 1:
        return read_scenario(path)
    there = shipped_scenarios()
    if named not in there:
        raise KinemimicError(
            f"expected a scenario that ships ({', '.join(there)}) or a file ending in .toml, found {named!r}"
        )
    return read_scenario(SHIPPED / f"{named}.toml")


def shipped_scenarios() -> tuple[str, ...]:
    """Names of the scenarios that ship."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.toml")))


def read_scenario(path: Path) -> Scenario:
    """The scenario of a file, which gives it its name."""
    try:
        text = read_bounded(path, MAX_BYTES, "a scenario").decode("utf-8")
    except FileNotFoundError:
        raise KinemimicError(f"{path}: expected a scenario, found no file") from None
    except UnicodeDecodeError as error:
        raise KinemimicError(f"{path}: expected TOML, found {error}") from None
    keys = Keys(path, "", parse_toml(path, text))
    about = keys.text("about", "")
    seconds = keys.number("seconds", 0.1, MAX_SECONDS) or 10.0
    phase = _range(keys, "phase", 1, 0.0, 1.0) or Range((0.0,), (1.0,))
    route = _route(keys)
    ground = keys.table("ground")
    friction = _range(ground, "friction", 1, 0.0, 2.0)
    slope = _range(ground, "slope", 1, -45.0, 45.0, scale=math.radians(1.0)) or Range.of(0.0)
    ground.finish()
    forces = [_load(item, "newton", "force", seconds) for item in _tables(keys, "force")]
    torques = [_load(item, "newton_metres", "torque", seconds) for item in _tables(keys, "torque")]
    obstacles = [one for item in _tables(keys, "obstacle") for one in _placements(item, seconds)]
    if len(obstacles) > MAX_ITEMS:
        keys.fail("obstacle", expected=f"at most {MAX_ITEMS} in all", found=f"{len(obstacles)}")
    keys.finish()
    if route and any(slope.low + slope.high):
        ground.fail("slope", expected="0 on a route, which changes its direction", found="a slope")
    if any(slope.low + slope.high) and any(item.mass.high[0] > 0 for item in obstacles):
        ground.fail(
            "slope", expected="0 where an obstacle can move", found="a slope", advice="give it mass 0"
        )
    loads = (*forces, *torques)
    return Scenario(path.stem, about, seconds, phase, friction, slope, route, loads, tuple(obstacles))


def _route(keys: Keys) -> tuple[tuple[float, float], ...]:
    """[[metres, degrees to the left], …]"""
    found = keys.get("route")
    if found is None:
        return ()
    if not isinstance(found, list) or len(found) > MAX_ITEMS:
        keys.fail("route", expected=f"at most {MAX_ITEMS} pairs [metres, degrees]", found=repr(found))
    pairs = [_row(keys, "route", pair, 2, -360.0, 360.0) for pair in found]
    for length, turn in pairs:
        if length < max(SHORTEST, TIGHTEST * abs(math.radians(turn))):
            keys.fail(
                "route",
                expected=f"lengths of {SHORTEST} m or more, and bends of a radius of {TIGHTEST} m or more",
                found=f"[{length:g}, {turn:g}]",
            )
    return tuple((length, math.radians(turn)) for length, turn in pairs)


def _tables(keys: Keys, name: str) -> Sequence[Keys]:
    """The tables [[name]]; in messages the first is "name 1"."""
    found = keys.get(name)
    if found is None:
        return []
    if not isinstance(found, list) or not all(isinstance(item, dict) for item in found):
        keys.fail(name, expected=f"tables [[{name}]]", found=repr(found))
    if len(found) > MAX_ITEMS:
        keys.fail(name, expected=f"at most {MAX_ITEMS}", found=f"{len(found)}")
    return [Keys(keys.path, f"{name} {number}", item) for number, item in enumerate(found, 1)]


def _load(keys: Keys, key: str, kind: str, seconds: float) -> Load:
    body = keys.choice("body", BODY_NAMES, "")
    at = _range(keys, "at", 1, 0.0, seconds - 1.0 / CONTROL_RATE) or Range.of(0.0)
    lasts = _range(keys, "lasts", 1, 1e-3, MAX_SECONDS) or Range.of(0.2)
    size = _needed(keys, key, _range(keys, key, 3, -_STRONG, _STRONG))
    growing = keys.get("growing")
    if growing is None:
        growing = False
    if not isinstance(growing, bool):
        keys.fail("growing", expected="true or false", found=repr(growing))
    keys.finish()
    parts: dict[str, Any] = {kind: size}
    return Load(body, at, lasts, growing=growing, **parts)


def _placements(keys: Keys, seconds: float) -> Sequence[Placement]:
    """`count` obstacles of the same ranges, which each draws for itself."""
    shape = keys.choice("shape", get_args(Shape), "")
    if shape == "sphere":
        width = _needed(keys, "size", _range(keys, "size", 1, 1e-2, _LONG))
        size = Range(width.low * 3, width.high * 3)
    elif shape == "cylinder":
        both = _needed(keys, "size", _range(keys, "size", 2, 1e-2, _LONG))
        size = Range((both.low[0], *both.low), (both.high[0], *both.high))
    else:
        size = _needed(keys, "size", _range(keys, "size", 3, 1e-2, _LONG))
    given = keys.get("position")
    first = given.get("from") if isinstance(given, dict) else given
    wide = 3 if isinstance(first, list) and len(first) == 3 else 2
    position = _needed(keys, "position", _range(keys, "position", wide, -_LONG, _LONG))
    height = size.high[0] if shape == "sphere" else size.high[2]
    if wide == 3 and position.low[2] < 0.5 * height:
        told = f"its centre at {0.5 * height:g} m or above, half its height"
        keys.fail("position", expected=told, found=f"{position.low[2]:g}")
    one = Placement(
        shape=shape,  # type: ignore[arg-type]
        size=size,
        position=position,
        turn=_range(keys, "turn", 1, -360.0, 360.0, scale=math.radians(1.0)) or Range.of(0.0),
        mass=_range(keys, "mass", 1, 0.0, _HEAVY) or Range.of(0.0),
        at=_range(keys, "at", 1, 0.0, seconds - 1.0 / CONTROL_RATE) or Range.of(0.0),
        velocity=_range(keys, "velocity", 3, -_FAST, _FAST) or Range.of(0.0, 0.0, 0.0),
        spin=_range(keys, "spin", 3, -_FAST, _FAST) or Range.of(0.0, 0.0, 0.0),
    )
    flies = any((*one.velocity.low, *one.velocity.high, *one.spin.low, *one.spin.high))
    if flies and one.mass.low[0] <= 0.0:
        keys.fail("mass", expected="more than 0 kg of what has a velocity or a spin", found="0")
    count = keys.whole("count", 1, 1, MAX_ITEMS)
    keys.finish()
    return [one] * count


def _range(keys: Keys, key: str, count: int, low: float, high: float, scale: float = 1.0) -> Range | None:
    """`count` numbers, or a table {from = …, to = …} with as many in each; None if the key is not there."""
    value = keys.get(key)
    if value is None:
        return None
    ends = [value, value]
    if isinstance(value, dict):
        if set(value) != {"from", "to"}:
            keys.fail(key, expected="{ from = …, to = … }", found=repr(value))
        ends = [value["from"], value["to"]]
    first, last = (_row(keys, key, end, count, low, high) for end in ends)
    if any(b < a for a, b in zip(first, last, strict=True)):
        keys.fail(key, expected="nothing in `from` above its `to`", found=repr(value))
    return Range(tuple(scale * v for v in first), tuple(scale * v for v in last))


def _row(keys: Keys, key: str, value: Any, count: int, low: float, high: float) -> tuple[float, ...]:
    row = value if isinstance(value, list) else [value]
    sound = all(isinstance(v, (int, float)) and not isinstance(v, bool) and low <= v <= high for v in row)
    if len(row) != count or not sound:
        what = "a number" if count == 1 else f"{count} numbers"
        keys.fail(key, expected=f"{what} from {low:g} to {high:g}", found=repr(value))
    return tuple(map(float, row))


def _needed(keys: Keys, key: str, value: Range | None) -> Range:
    if value is None:
        keys.fail(key, expected="numbers", found="none")
    return value
