"""A live capture as a reference that never ends: the person's pose and path, or standing while nobody is
there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import IDENTITY, from_axis_angle, multiply, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import NODES, SIDES
from kinemimic.pipeline.live.capture import Moment
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.humanoid.surface import lowest_points
from kinemimic.retarget.live.lean import LiveLean
from kinemimic.retarget.live.on_the_spot import OnTheSpot
from kinemimic.retarget.live.path import LivePath
from kinemimic.retarget.live.pose import LivePose, mixed

FADE_TIME = 0.5  # s between standing and the person
PATIENCE = 0.3  # s for which the last pose is held before the person counts as lost
NOISE_TIME = 1.0  # s of walking after which noise can be told from it, and is removed
STANDING_KNEE = 0.1  # rad: straight knees would lock


def standing() -> Array:
    """Local rotations (20, 4) of a person who stands, facing +X."""
    rotations = np.tile(IDENTITY, (len(NODES), 1))
    for side in SIDES:
        rotations[N[f"hip_{side}"]] = from_axis_angle("Y", -0.5 * STANDING_KNEE)
        rotations[N[f"knee_{side}"]] = from_axis_angle("Y", STANDING_KNEE)
        rotations[N[f"ankle_{side}"]] = from_axis_angle("Y", -0.5 * STANDING_KNEE)
    return rotations


@dataclass(frozen=True)
class Performed:
    """A moment of the reference.

    root: (3,) m; rotations: (20, 4) local; presence: 0 (stands) to 1 (follows the person); appeared: a
    person appears at this frame; noise: 0 (precise, or no steps) to 1 (a walk seen by a depth sensor);
    on_the_spot: the person goes nowhere, or nobody is there.
    """

    root: Array
    rotations: Array
    presence: float
    appeared: bool
    noise: float
    on_the_spot: bool


class Performer:
    """Turns moments, or their absence, into the frames of a reference.

    people: number of times a person appeared.
    """

    def __init__(self, rate: float) -> None:
        self.people = self.lost = 0
        self._rate = rate
        self._presence = 0.0
        self._absent = float("inf")
        self._walked = self._noise = 0.0  # s of a noisy walk; share of noise in the newest frame
        self._rotations = standing()
        self._velocity, self._height = np.zeros(2), float(_standing_height(standing()))
        self._place = np.zeros(2)
        self._yaw = 0.0  # of the reference over the capture
        self._lean = LiveLean(rate)
        self._on_the_spot = True
        self._new()

    def _new(self) -> None:
        self.pose, self._path = LivePose(self._rate), LivePath(self._rate)
        self._spot = OnTheSpot(self._rate)
        self._lean.restart()

    def perform(self, moment: Moment | None) -> Performed:
        """The next frame of the reference."""
        appeared = False
        if moment is not None and moment.shows_person:
            if self._absent > PATIENCE:
                appeared = True
                self.people += 1
                self._new()
            window = self.pose.window(moment)
            step = self._path.step(window, precise=self.pose.reliability.precise)
            rotations = window.rotations[window.now].copy()
            if appeared:
                self._yaw = _yaw_of(self._rotations[0]) - _yaw_of(rotations[0])
            turn = from_axis_angle("Z", self._yaw)
            rotations[0] = multiply(turn, rotations[0])
            self._rotations = rotations
            self._velocity = rotate(turn, np.append(step.velocity, 0.0))[:2]
            self._on_the_spot = self._spot.update(self._velocity, strides=window.strides)
            self._height, self._absent = step.height, 0.0
        else:
            before, self._absent = self._absent, self._absent + 1.0 / self._rate
            self.lost += before <= PATIENCE < self._absent
            self._velocity = 0.9 * self._velocity
        wanted = float(self._absent <= PATIENCE)
        change = 1.0 / (FADE_TIME * self._rate)
        self._presence += min(max(wanted - self._presence, -change), change)
        share = self._presence**2 * (3.0 - 2.0 * self._presence)
        self._place = self._place + share * self._velocity / self._rate
        if share >= 1.0:
            rotations, height = self._rotations, self._height
        else:
            still = standing()
            still[0] = from_axis_angle("Z", _yaw_of(self._rotations[0]))
            rotations = mixed(still, self._rotations, share)
            height = _standing_height(rotations)
            height += share * (self._height - _standing_height(self._rotations))
        # What is not reliable is measured in standing, and neutral in a walk.
        pelvis = self.pose.reliability.pelvis if share >= 1.0 else 1.0
        self._walked = self._walked + 1.0 / self._rate if pelvis < 1.0 else 0.0
        noise = min(1.0, self._walked / NOISE_TIME) * (1.0 - pelvis)
        self._noise = max(noise, self._noise - change)
        on_the_spot = self._on_the_spot or share <= 0.0
        rotations, root = self._lean.applied(
            rotations, np.append(self._place, height), _yaw_of(rotations[0]),
            on_the_spot=on_the_spot and share > 0.0,
        )  # fmt: skip
        return Performed(root, rotations, share, appeared, self._noise, on_the_spot)


def _yaw_of(q: Array) -> float:
    """Heading in radians of the x-axis of a rotation (4,)."""
    ahead = rotate(q, np.array([1.0, 0.0, 0.0]))
    return float(np.arctan2(ahead[1], ahead[0]))


def _standing_height(rotations: Array) -> float:
    """Height in metres of the hips over the ground if the lowest body (20, 4) touches it."""
    positions, frames = body_kinematics(rotations[None])
    return -float(lowest_points(positions, frames)[0, :, 2].min())
