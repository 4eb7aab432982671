"""The event schedule of a trial: loads, friction, slope and obstacles drawn from a scenario, with times."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.rotations import multiply, rotate
from kinemimic.retarget.humanoid.body import BODIES, BODY_INDEX, BODY_MASSES
from kinemimic.train.reference.heading import heading
from kinemimic.train.reference.reference import Reference
from kinemimic.train.scenario.overlap import obstacles_overlap, overlapping_body
from kinemimic.train.scenario.scenario import Placement, Scenario
from kinemimic.train.sim.world import CONTROL_RATE, BodyStates, Obstacle

# Redraws of an obstacle that overlaps the humanoid or another obstacle.
_DRAWS = 50
_LOOKS = 100  # trials that `check` draws before training


@dataclass(frozen=True)
class EventSchedule:
    """begins, ends: (L,) control steps between which a load acts; bodies: (L,) their indices; wrenches: (L,
    6) force and torque in the world, N and N·m; growing: (L,); friction: None for the humanoid's own; tilt:
    (3,) m/s² that a slope adds to gravity; releases: (control step, obstacle at that time in the world),
    sorted."""

    begins: NDArray[np.int64]
    ends: NDArray[np.int64]
    bodies: NDArray[np.intp]
    wrenches: Array
    growing: NDArray[np.bool_]
    friction: float | None
    tilt: Array
    releases: tuple[tuple[int, Obstacle], ...]

    def wrench(self, age: int, mass: float = 1.0) -> Array | None:
        """(15, 6) on the bodies in the control step that starts at this age; None without loads.

        mass: factor for the nominal masses.
        """
        acts = (self.begins <= age) & (age < self.ends)
        if not (acts.any() or self.tilt.any()):
            return None
        total = np.zeros((len(BODIES), 6))
        total[:, :3] = mass * BODY_MASSES[:, None] * self.tilt
        # A growing load has its mean over the step.
        shares = np.where(self.growing, (age + 0.5 - self.begins) / (self.ends - self.begins), 1.0)
        np.add.at(total, self.bodies[acts], shares[acts, None] * self.wrenches[acts])
        return total

    def released(self, before: int) -> list[Obstacle]:
        """The obstacles that appeared before a control step, earliest first."""
        return [item for step, item in self.releases if step < before]


def draw_event_schedule(
    scenario: Scenario, reference: Reference, phase: float, random: np.random.Generator
) -> EventSchedule:
    """Draw the events of a trial that starts at a phase.

    KinemimicError if every redraw of an obstacle overlaps the reference's humanoid, or another obstacle that
    appears at the same time.
    """
    loads = scenario.loads
    begins = np.array([_step(load.at.draw(random)) for load in loads], dtype=np.int64)
    lengths = np.array([max(1, _step(load.lasts.draw(random))) for load in loads], dtype=np.int64)
    wrenches = np.zeros((len(loads), 6))
    for k, load in enumerate(loads):
        turn = _about_vertical(heading(reference, phase + _phases(reference, begins[k])))
        wrenches[k, :3] = rotate(turn, load.force.draw(random))
        wrenches[k, 3:] = rotate(turn, load.torque.draw(random))
    slope = float(scenario.slope.draw(random)[0])
    placed: list[tuple[int, Obstacle]] = []
    for item in scenario.obstacles:
        placed.append(_place(scenario, placed, item, reference, phase, random))
    return EventSchedule(
        begins=begins,
        ends=begins + lengths,
        bodies=np.array([BODY_INDEX[load.body] for load in loads], dtype=np.intp),
        wrenches=wrenches,
        growing=np.array([load.growing for load in loads], dtype=np.bool_),
        friction=None if scenario.friction is None else float(scenario.friction.draw(random)[0]),
        tilt=slope_tilt(slope, heading(reference, phase)),
        releases=tuple(sorted(placed, key=lambda release: release[0])),
    )


def slope_tilt(slope: float, uphill: float) -> Array:
    """What a slope, rad, adds to gravity, (3,) m/s²; uphill: its direction, rad about the vertical from the
    x-axis."""
    along = rotate(_about_vertical(uphill), np.array([math.sin(slope), 0.0, 0.0]))
    tilt: Array = GRAVITY * (np.array([0.0, 0.0, 1.0 - math.cos(slope)]) - along)
    return tilt


def check(scenario: Scenario, reference: Reference) -> None:
    """Draw trials from many phases; raises KinemimicError, as `draw_event_schedule`, if one is impossible."""
    for number in range(_LOOKS):
        random = np.random.default_rng(number)
        draw_event_schedule(scenario, reference, float(scenario.phase.draw(random)[0]), random)


def _place(
    scenario: Scenario,
    placed: Sequence[tuple[int, Obstacle]],
    item: Placement,
    reference: Reference,
    phase: float,
    random: np.random.Generator,
) -> tuple[int, Obstacle]:
    step = _step(item.at.draw(random))
    then = phase + _phases(reference, step)
    bodies = reference.bodies(np.array([then]))
    humanoid = BodyStates(bodies.positions[0], bodies.rotations[0], bodies.linear[0], bodies.angular[0])
    ahead, below = (
        _about_vertical(heading(reference, then)),
        reference.root(np.array([then]))[0] * [1.0, 1.0, 0.0],
    )
    if scenario.route and step == 0:
        ahead, below = _about_vertical(0.0), np.zeros(3)
    for _ in range(_DRAWS):
        obstacle = _obstacle(item, random)
        obstacle = replace(
            obstacle,
            position=tuple(below + rotate(ahead, np.array(obstacle.position))),
            rotation=tuple(multiply(ahead, np.array(obstacle.rotation))),
            velocity=tuple(rotate(ahead, np.array(obstacle.velocity))),
            spin=tuple(rotate(ahead, np.array(obstacle.spin))),
        )
        inside = overlapping_body(obstacle, humanoid)
        if inside is not None:
            continue
        others = [
            k
            for k, (when, other) in enumerate(placed, 1)
            if when == step and obstacles_overlap(obstacle, other)
        ]
        if not others:
            return step, obstacle
        inside = f"obstacle {others[0]}"
    where = f"{inside} {step / CONTROL_RATE:.2f} s after the start, from phase {phase:.2f}"
    raise KinemimicError(
        f"scenario {scenario.name}: expected obstacle {len(placed) + 1} ({item.shape}) apart from the "
        f"humanoid and from other obstacles, found it in {where}; place it elsewhere"
    )


def _obstacle(item: Placement, random: np.random.Generator) -> Obstacle:
    """One draw, relative to the reference at the origin."""
    size, place = item.size.draw(random), item.position.draw(random)
    height = size[0] if item.shape == "sphere" else size[2]
    center = place if len(place) == 3 else np.append(place, 0.5 * height)
    return Obstacle(
        shape=item.shape,
        size=tuple(size),
        position=tuple(center),
        rotation=tuple(_about_vertical(float(item.turn.draw(random)[0]))),
        mass=float(item.mass.draw(random)[0]),
        velocity=tuple(item.velocity.draw(random)),
        spin=tuple(item.spin.draw(random)),
    )


def _step(seconds: Array) -> int:
    return round(float(seconds[0]) * CONTROL_RATE)


def _phases(reference: Reference, steps: float) -> float:
    return float(steps) / (CONTROL_RATE * reference.duration)


def _about_vertical(angle: float) -> Array:
    """Rotation (4,) about the vertical."""
    return np.array([0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle)])


def with_states(obstacles: Sequence[Obstacle], states: Array) -> list[Obstacle]:
    """Obstacles with the states (K, 13) of `World.obstacles`."""
    return [
        replace(
            item,
            position=tuple(state[0:3]),
            rotation=tuple(state[3:7]),
            velocity=tuple(state[7:10]),
            spin=tuple(state[10:13]),
        )
        for item, state in zip(obstacles, states.tolist(), strict=True)
    ]
