"""The forces of a session: drags, pushes and carried weights, as wrenches on the bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from kinemimic.evaluate.simulate.session.inputs import Carry, Drag, Push, Release
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
    """What acts on the humanoid; carried: kg by body."""

    carried: dict[int, float] = field(default_factory=dict)
    _loads: list[_Load] = field(default_factory=list)
    _drag: Drag | None = None

    @property
    def dragged(self) -> int | None:
        """Index of the body that is dragged."""
        return None if self._drag is None else BODY_INDEX[self._drag.body]

    def apply(self, event: Drag | Release | Push | Carry, bodies: BodyStates) -> None:
        """Begin or end a force."""
        if isinstance(event, Drag):
            self._drag = event
        elif isinstance(event, Release):
            self._drag = None
        elif isinstance(event, Carry):
            self.carried[BODY_INDEX[event.body]] = event.kilograms
        else:
            turn = heading_turn(bodies)
            wrench = np.concatenate([rotate(turn, np.array(v)) for v in (event.force, event.torque)])
            self._loads.append(_Load(BODY_INDEX[event.body], wrench, event.steps, event.growing))

    def spring(self, bodies: BodyStates) -> Array | None:
        """Grab point, pointer and force (3, 3) of the drag in the world, None without one."""
        return None if self._drag is None else spring(self._drag, bodies)

    def wrenches(self, bodies: BodyStates, tilt: Array) -> tuple[Array, Array | None]:
        """Wrenches (1, 15, 6) of the next control step; grab point, pointer and force (3, 3) of a drag.

        tilt: (3,) m/s² that a slope adds to gravity; it acts here on carried weights alone.
        """
        total = np.zeros((1, len(BODIES), 6))
        for load in self._loads:
            # A growing load has its mean over the step.
            share = (load.age + 0.5) / load.steps if load.growing else 1.0
            total[0, load.body] += share * load.wrench
            load.age += 1
        self._loads = [load for load in self._loads if load.age < load.steps]
        for body, kilograms in self.carried.items():
            total[0, body, :3] += kilograms * (tilt - np.array([0.0, 0.0, GRAVITY]))
        if self._drag is None:
            return total, None
        shown = spring(self._drag, bodies)
        body = BODY_INDEX[self._drag.body]
        total[0, body, :3] += shown[2]
        total[0, body, 3:] += np.cross(shown[0] - bodies.positions[0, body], shown[2])
        return total, shown


def weights(tilt: Array) -> Array:
    """Forces (15, 3) on the bodies of what a slope adds to gravity, (3,) m/s²."""
    forces: Array = BODY_MASSES[:, None] * tilt
    return forces


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
