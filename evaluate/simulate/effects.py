"""The forces of a session: drags, pushes, carried weights and a slope, as wrenches on the bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from kinemimic.evaluate.simulate.inputs import Carry, Drag, Push, Release
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX, BODY_MASSES
from kinemimic.train.sim.world import CONTROL_RATE, BodyStates

# Of the spring's stiffness, s: without it, a dragged hand swings about the pointer.
DAMPING = 0.08


@dataclass
class _Load:
    """A wrench (6,) on a body for `steps` control steps, of which `age` have passed."""

    body: int
    wrench: Array
    steps: int
    growing: bool
    age: int = 0


@dataclass
class Effects:
    """What acts on the humanoid; carried: weight in N by body."""

    carried: dict[int, float] = field(default_factory=dict)
    _loads: list[_Load] = field(default_factory=list)
    _drag: Drag | None = None

    def apply(self, found: Drag | Release | Push | Carry, bodies: BodyStates) -> None:
        """Begin or end a force."""
        if isinstance(found, Drag):
            self._drag = found
        elif isinstance(found, Release):
            self._drag = None
        elif isinstance(found, Carry):
            self.carried[BODY_INDEX[found.body]] = GRAVITY * found.kilograms
        else:
            turn = heading_turn(bodies)
            wrench = np.concatenate([rotate(turn, np.array(v)) for v in (found.force, found.torque)])
            self._loads.append(_Load(BODY_INDEX[found.body], wrench, found.steps, found.growing))

    def wrenches(self, bodies: BodyStates, tilt: Array) -> tuple[Array, Array | None]:
        """Wrenches (1, 15, 6) of the next control step; grab point, pointer and force (3, 3) of a drag.

        tilt: (3,) m/s² that a slope adds to gravity.
        """
        total = np.zeros((1, len(BODIES), 6))
        for load in self._loads:
            # A growing load has its mean over the step.
            share = (load.age + 0.5) / load.steps if load.growing else 1.0
            total[0, load.body] += share * load.wrench
            load.age += 1
        self._loads = [load for load in self._loads if load.age < load.steps]
        for body, weight in self.carried.items():
            total[0, body, 2] -= weight
        total[0, :, :3] += weights(tilt)
        if self._drag is None:
            return total, None
        shown = spring(self._drag, bodies)
        body = BODY_INDEX[self._drag.body]
        total[0, body, :3] += shown[2]
        total[0, body, 3:] += np.cross(shown[0] - bodies.positions[0, body], shown[2])
        return total, shown


def slope_tilt(bodies: BodyStates, slope: float) -> Array:
    """What a slope, rad, uphill where the first humanoid's pelvis faces, adds to gravity: (3,) m/s²."""
    along = rotate(heading_turn(bodies), np.array([math.sin(slope), 0.0, 0.0]))
    found: Array = GRAVITY * (np.array([0.0, 0.0, 1.0 - math.cos(slope)]) - along)
    return found


def weights(tilt: Array) -> Array:
    """Forces (15, 3) on the bodies of what a slope adds to gravity, (3,) m/s²."""
    found: Array = BODY_MASSES[:, None] * tilt
    return found


def spring(drag: Drag, bodies: BodyStates) -> Array:
    """Grab point, pointer and force (3, 3) of a drag in the world.

    The force acts for a whole control step, so that it is computed for the end of that step (an implicit
    spring): a stiff one would otherwise fling a light hand away.
    """
    body, dt = BODY_INDEX[drag.body], 1.0 / CONTROL_RATE
    arm = rotate(bodies.rotations[0, body], np.array(drag.grab))
    grab, pointer = bodies.positions[0, body] + arm, np.array(drag.pointer)
    speed = bodies.linear[0, body] + np.cross(bodies.angular[0, body], arm)
    damping = DAMPING * drag.stiffness
    heavier = 1.0 + (drag.stiffness * dt + damping) * dt / BODY_MASSES[body]
    force = (drag.stiffness * (pointer - grab - dt * speed) - damping * speed) / heavier
    size = float(np.linalg.norm(force))
    if size > drag.limit:
        force *= drag.limit / size
    return np.stack([grab, pointer, force])


def heading_turn(bodies: BodyStates) -> Array:
    """Rotation (4,) about the vertical from the world to where the first humanoid's pelvis faces."""
    ahead = rotate(bodies.rotations[0, 0], np.array([1.0, 0.0, 0.0]))
    angle = math.atan2(ahead[1], ahead[0])
    return np.array([0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle)])
