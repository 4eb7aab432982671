"""What a session shows: the state after a control step, its score, and how a live capture is followed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Annotated, Any

import numpy as np
from msgspec import Meta, Struct
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.live.capture import LAG
from kinemimic.train.sim.world import CONTROL_RATE, BodyStates, Obstacle


@dataclass(frozen=True)
class Status:
    """What a page says about its session: text (Markdown), and which of its buttons are on."""

    text: str
    paused: bool = False
    recording: bool = False


@dataclass(frozen=True)
class Frame:
    """The state after a control step.

    bodies, target: of the humanoid and its reference (15, 3 or 4); contacts: (15, 3) contact forces, N;
    loads, torques: (15, 3) from outside, N and N·m, without the slope's; tilt: (3,) m/s² that a slope adds to
    gravity; drag: grab point, pointer and force (3, 3) of a drag, or None; dragged: the body it pulls;
    obstacles: with their states now (K, 13); numbers: of the obstacles, no two in a session have the same;
    rotations, reference_rotations: (20, 4) of the nodes, local; angles, wanted: knee and hip flexion
    by name, of the humanoid and its reference, rad; terms: of the reward; fallen: since the last restart;
    shown: what a live capture shows; companions: of a session that has some.
    """

    step: int
    phase: float
    bodies: BodyStates
    target: BodyStates
    contacts: Array
    loads: Array
    torques: Array
    tilt: Array
    drag: Array | None
    dragged: int | None
    obstacles: tuple[Obstacle, ...]
    states: Array
    numbers: tuple[int, ...]
    rotations: Array
    reference_rotations: Array
    angles: dict[str, float]
    wanted: dict[str, float]
    terms: dict[str, float]
    fallen: bool
    shown: LiveView | None = None
    companions: Companions | None = None


@dataclass(frozen=True)
class Companions:
    """N more humanoids: positions (N, 15, 3), m, and rotations (N, 15, 4) of their bodies; fallen: (N,)."""

    positions: Array
    rotations: Array
    fallen: NDArray[np.bool_]


@dataclass(frozen=True)
class LiveView:
    """A live capture at the end of a control step.

    raw, clean: (20, 3) m, the newest frame as it came, and as the reference uses it, NaN where missing;
    time: s on the sender's clock, of the newest frame of the reference, NaN where starved; presence: 0
    (nobody) to 1; latency: s from the moment that the humanoid performs to the newest frame, NaN where
    starved; people: number of times a person appeared; starved: whether no frame was due.
    """

    raw: Array
    clean: Array
    time: float
    presence: float
    latency: float
    people: int
    starved: bool

    @property
    def follows(self) -> bool:
        """Whether a person is in view and the reference is theirs, not on its way to or from standing."""
        return self.presence >= 1.0 and not self.starved


class LiveSettings(Struct, frozen=True):
    """How a live capture is followed.

    lag: of the filter, s; up: the axis of the sender that points up, None to recognise it; place: put the
    humanoid onto its reference when a person appears, instead of letting it start from standing; denoise:
    remove a depth sensor's noise from walking.
    """

    lag: Annotated[float, Meta(ge=0.0, le=1.0)] = LAG
    up: str | None = None
    place: bool = False
    denoise: bool = True


@dataclass(frozen=True)
class Score:
    """Of the last `frames` control steps: R² of knee and hip, speed along the reference's path as a share
    of its own (NaN where the reference stays in its place), steps upright."""

    frames: int
    upright: int
    knee: float
    hip: float
    speed: float

    def __str__(self) -> str:
        seconds = self.frames / CONTROL_RATE
        knee, hip, speed = (
            f"{value:.{digits}f}" if math.isfinite(value) else "undefined"
            for value, digits in ((self.knee, 3), (self.hip, 3), (self.speed, 2))
        )
        return (
            f"last {seconds:.0f} s: R² of knee {knee}, hip {hip}, speed {speed}, "
            f"upright in {self.upright} of {self.frames} steps"
        )

    def to_json(self) -> dict[str, float | None]:
        """JSON values, None for NaN."""
        return {name: value if math.isfinite(value) else None for name, value in asdict(self).items()}

    @classmethod
    def from_json(cls, value: Mapping[str, Any]) -> Score:
        """What `to_json` gave."""
        known: dict[str, Any] = {name: math.nan if one is None else one for name, one in value.items()}
        return cls(**known)
