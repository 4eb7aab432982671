"""The obstacles of a session: thrown by people, or those of a scenario."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from kinemimic.evaluate.simulate.session.effects import heading_turn
from kinemimic.evaluate.simulate.session.inputs import Throw
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.train.scenario.event_schedule import with_states
from kinemimic.train.sim.world import BodyStates, Obstacle
from kinemimic.train.task.env import ImitationBatch

MAX_OBSTACLES = 20


class Obstacles:
    """The obstacles in a world: in a scenario its own, otherwise those that people threw.

    first: number of the first one; the others follow. No two obstacles of a session have the same number, so
    the next world of a session begins with a number that is still free.
    """

    def __init__(self, batch: ImitationBatch, first: int = 0) -> None:
        self._batch, self.first = batch, first
        self._thrown: list[Obstacle] = []

    @property
    def present(self) -> list[Obstacle]:
        """The obstacles that are there now."""
        scheduled = self._batch.scheduled_obstacles(0)
        return self._thrown if scheduled is None else scheduled

    @property
    def numbers(self) -> range:
        """The numbers of `present`."""
        return range(self.first, self.first + len(self.present))

    @property
    def can_move(self) -> bool:
        """Whether a thrown obstacle has a mass."""
        return any(item.mass > 0.0 for item in self._thrown)

    def throw(self, obstacle: Obstacle) -> None:
        """Add an obstacle; of more than MAX_OBSTACLES, the oldest is removed."""
        obstacles = [*self._moved(), obstacle]
        self.first += max(0, len(obstacles) - MAX_OBSTACLES)
        self._place(obstacles[-MAX_OBSTACLES:])

    def clear(self) -> None:
        """Before a reset: remove thrown obstacles. Those that a scenario then places get new numbers."""
        self.first = self.numbers.stop
        if self._batch.config.scenario is None:
            self._place([])

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Put thrown obstacles back as they are now, after a reset of the world in the block."""
        obstacles = self._moved()
        yield
        self._place(obstacles)

    def _moved(self) -> list[Obstacle]:
        """Thrown obstacles in their states now."""
        return with_states(self._thrown, self._batch.world.obstacles(0))

    def _place(self, obstacles: list[Obstacle]) -> None:
        self._thrown = obstacles
        self._batch.world.place(0, obstacles)


def thrown_by(event: Throw, bodies: BodyStates) -> Obstacle:
    """The obstacle that an input places, relative to the ground below the first humanoid's hips."""
    turn, below = heading_turn(bodies), bodies.positions[0, 0] * [1.0, 1.0, 0.0]
    return Obstacle(
        shape=event.shape,
        size=event.size,
        position=tuple((below + rotate(turn, np.array(event.position))).tolist()),
        rotation=tuple(turn.tolist()),
        mass=event.mass,
        velocity=tuple(rotate(turn, np.array(event.velocity)).tolist()),
    )
