"""What a person can do to a running session, as data with bounds: the buttons, sliders and drags of the page.

Vectors of loads and obstacles are (ahead, left, up) of the humanoid at that time; those of a drag are in the
world. All lengths are metres, forces newtons, torques newton metres, angles radians.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.humanoid.body import BODY_INDEX
from kinemimic.train.sim.world import Shape

MAX_FORCE = 2000.0
_Place = Annotated[float, Meta(ge=-1e5, le=1e5)]
_Force = Annotated[float, Meta(ge=-MAX_FORCE, le=MAX_FORCE)]
_Near = Annotated[float, Meta(ge=-20.0, le=20.0)]
_Size = Annotated[float, Meta(ge=0.01, le=5.0)]
_Text = Annotated[str, Meta(max_length=100)]


class Drag(Struct, tag="drag", frozen=True):
    """Pull a body with a spring until `Release`.

    grab: point of the body in its own frame, from its centre of mass; pointer: where it is pulled to;
    stiffness: N/m; limit: largest force, N.
    """

    body: str
    grab: tuple[_Near, _Near, _Near]
    pointer: tuple[_Place, _Place, _Place]
    stiffness: Annotated[float, Meta(ge=0.0, le=5000.0)] = 300.0
    limit: Annotated[float, Meta(ge=0.0, le=MAX_FORCE)] = 300.0


class Release(Struct, tag="release", frozen=True):
    """End a drag."""


class Push(Struct, tag="push", frozen=True):
    """A force or torque on a body for some control steps; growing: linearly from 0."""

    body: str
    force: tuple[_Force, _Force, _Force] = (0.0, 0.0, 0.0)
    torque: tuple[_Force, _Force, _Force] = (0.0, 0.0, 0.0)
    steps: Annotated[int, Meta(ge=1, le=3000)] = 6
    growing: bool = False


class Throw(Struct, tag="throw", frozen=True):
    """Place an obstacle, at rest or moving. position: of its centre, from the ground below the hips."""

    shape: Shape
    size: tuple[_Size, _Size, _Size]
    mass: Annotated[float, Meta(ge=0.0, le=200.0)]
    position: tuple[_Near, _Near, _Near]
    velocity: tuple[_Near, _Near, _Near] = (0.0, 0.0, 0.0)


class Clear(Struct, tag="clear", frozen=True):
    """Remove all obstacles, and end all pushes; a scenario keeps its obstacles."""


class Ground(Struct, tag="ground", frozen=True):
    """friction: of the humanoid's bodies; slope: rad, uphill where the reference then goes, by tilting
    gravity. Neither applies in a scenario, which has its own ground."""

    friction: Annotated[float, Meta(ge=0.0, le=2.0)] = 0.9
    slope: Annotated[float, Meta(ge=-0.35, le=0.35)] = 0.0


class Carry(Struct, tag="carry", frozen=True):
    """A weight that hangs from a body: its weight alone acts, not its inertia."""

    body: str
    kilograms: Annotated[float, Meta(ge=0.0, le=50.0)]


class Restart(Struct, tag="restart", frozen=True):
    """Put the humanoid onto its reference."""

    phase: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.0


class Enter(Struct, tag="enter", frozen=True):
    """Restart in a scenario by name, or in none; trial: its number, as in `disturb` and `view`."""

    scenario: _Text = ""
    trial: Annotated[int, Meta(ge=0, le=2**31)] = 0


Input = Drag | Release | Push | Throw | Clear | Ground | Carry | Restart | Enter


def checked(event: Input) -> Input:
    """An input within its bounds; KinemimicError otherwise."""
    return decoded(msgspec.json.encode(event))


def decoded(text: bytes | str) -> Input:
    """The input in a line of JSON; KinemimicError for anything else."""
    try:
        event: Input = msgspec.json.decode(text, type=Input)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise KinemimicError(f"expected an input of a session, found {error}") from None
    if (body := getattr(event, "body", None)) is not None and body not in BODY_INDEX:
        raise KinemimicError(f"expected a body of the humanoid, found {body!r:.40}")
    return event


def finite(*numbers: Any) -> bool:
    """Whether all numbers are finite: JSON has none that are not, a page's events may."""
    return all(math.isfinite(float(number)) for number in numbers)
