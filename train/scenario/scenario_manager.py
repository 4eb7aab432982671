"""Applies a scenario to the environments of a world, each with its own event schedule."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.train.reference.reference import Reference
from kinemimic.train.scenario.event_schedule import EventSchedule, draw_event_schedule, with_states
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.sim.world import Obstacle, World


class ScenarioManager:
    """Event schedules of E environments, none active until `begin`. Ages are control steps since then."""

    def __init__(self, scenario: Scenario, reference: Reference, world: World) -> None:
        self._scenario, self._reference, self._world = scenario, reference, world
        self._schedules: list[EventSchedule | None] = [None] * world.size
        self._seeds = np.zeros(world.size, dtype=np.uint64)
        self._phases: Array = np.zeros(world.size)

    def begin(self, indices: NDArray[np.intp], phases: Array, seeds: NDArray[np.uint64] | None) -> None:
        """Draw schedules from seeds (N,) for environments (N,) that start at phases (N,), or none without
        seeds; call it before their reset."""
        for k, index in enumerate(indices):
            before = self._schedules[index]
            schedule = None if seeds is None else self._draw(seeds[k], phases[k])
            self._schedules[index] = schedule
            if schedule is not None:
                self._seeds[index], self._phases[index] = seeds[k], phases[k]  # type: ignore[index]
            if schedule is not None or (before is not None and before.releases):
                self._world.place(index, [] if schedule is None else schedule.released(1))

    def _draw(self, seed: np.uint64, phase: float) -> EventSchedule:
        return draw_event_schedule(
            self._scenario, self._reference, float(phase), np.random.default_rng(int(seed))
        )

    def friction(self, indices: NDArray[np.intp], usual: Array) -> Array:
        """Friction (N,) of environments (N,): the scenario's, or the usual one (N,)."""
        schedules = [self._schedules[index] for index in indices]
        own_values = [None if schedule is None else schedule.friction for schedule in schedules]
        return np.array([value if own is None else own for own, value in zip(own_values, usual, strict=True)])

    def act(self, ages: NDArray[np.int64], masses: Array) -> Array | None:
        """Place the obstacles due before the step that starts at ages (E,), and return the wrenches (E, 15,
        6) of that step, None if there are none; masses: (E,) factors for the nominal masses."""
        total = None
        for index, schedule in enumerate(self._schedules):
            if schedule is None:
                continue
            age = int(ages[index])
            if age and any(step == age for step, _ in schedule.releases):
                visible = with_states(schedule.released(age), self._world.obstacles(index))
                self._world.place(index, [*visible, *schedule.released(age + 1)[len(visible) :]])
            wrench = schedule.wrench(age, float(masses[index]))
            if wrench is not None:
                total = np.zeros((len(self._schedules), len(BODIES), 6)) if total is None else total
                total[index] = wrench
        return total

    def present(self, index: int, age: int) -> list[Obstacle]:
        """The obstacles of an environment that have appeared before the step that starts at this age."""
        schedule = self._schedules[index]
        return [] if schedule is None else schedule.released(max(1, age))

    def tilt(self, index: int) -> Array:
        """What the slope of an environment adds to gravity, (3,) m/s²."""
        schedule = self._schedules[index]
        return np.zeros(3) if schedule is None else schedule.tilt

    def snapshot(self) -> dict[str, NDArray[Any]]:
        """The state for `restore`, arrays (E, ...): which have a schedule, its seed and phase, and the
        obstacles' states."""
        states = np.zeros((self._world.size, len(self._scenario.obstacles), 13))
        for index, schedule in enumerate(self._schedules):
            if schedule is not None:
                found = self._world.obstacles(index)
                states[index, : len(found)] = found
        return {
            "on_course": np.array([schedule is not None for schedule in self._schedules]),
            "course_seeds": self._seeds.copy(),
            "course_phases": self._phases.copy(),
            "obstacles": states,
        }

    def restore(self, snapshot: Mapping[str, NDArray[Any]], ages: NDArray[np.int64]) -> None:
        """Set all schedules and obstacles to a snapshot; call it before the reset of the environments."""
        seeds, phases = snapshot["course_seeds"].copy(), snapshot["course_phases"].copy()
        same = (seeds == self._seeds) & (phases == self._phases)
        self._seeds, self._phases = seeds, phases
        for index, on in enumerate(snapshot["on_course"]):
            before = self._schedules[index]
            schedule = before if same[index] and on else None
            if on and schedule is None:
                schedule = self._draw(self._seeds[index], self._phases[index])
            self._schedules[index] = schedule
            if schedule is None and before is None:
                continue
            visible = [] if schedule is None else schedule.released(max(1, int(ages[index])))
            self._world.place(index, with_states(visible, snapshot["obstacles"][index, : len(visible)]))
