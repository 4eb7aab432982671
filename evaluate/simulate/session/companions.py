"""More humanoids beside a session's: how many withstand the same push, from other phases of the motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kinemimic.evaluate.simulate.session.effects import Effects, heading_turn, weights
from kinemimic.evaluate.simulate.session.frame import Companions, Frame
from kinemimic.evaluate.simulate.session.inputs import Carry, Clear, Enter, Ground, Input, Push, Restart
from kinemimic.evaluate.simulate.session.session import LYING, Session, policy_actions
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.pipeline.live.frame import CapturedFrame
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.reference.heading import heading
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.scenario.event_schedule import slope_tilt
from kinemimic.train.scenario.route import reference_for
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import BodyStates
from kinemimic.train.task.domain_randomization import RandomizationSample
from kinemimic.train.task.env import ImitationBatch

ROW = 5  # humanoids in a row, of which the session's is the first of the first
APART, BEHIND = 1.5, 2.0  # m between neighbours, and between rows


class AccompaniedSession(Session):
    """A session beside whose humanoid `count` others perform the same motion from phases between its own.

    Pushes, carried weights and ground act on all of them; drags, obstacles and scenarios on the session's own
    alone, and in a scenario it is alone. The session's own humanoid moves as without the others, to the bit.
    """

    def __init__(
        self,
        motion: Motion,
        policy: Policy | None,
        config: EnvConfig,
        engine: str,
        count: int,
        *,
        restart: bool = True,
        scenario_named: Callable[[str], Scenario] | None = None,
    ) -> None:
        self._others: _Batch | None = None
        self._fell = False  # since the last push
        super().__init__(motion, policy, config, engine, restart=restart, scenario_named=scenario_named)
        self._others = _Batch(motion, policy, config, engine, count, restart=restart)
        self._others.begin(0.0, self._batch.target)

    @property
    def _present(self) -> _Batch | None:
        """The others, None in a scenario."""
        return self._others if self._batch.config.scenario is None else None

    def _reset(self, phase: float) -> None:
        before = self._batch.target.positions[0, 0].copy()
        super()._reset(phase)
        if self._others is not None:
            self._others.shift(self._batch.target.positions[0, 0] - before)

    def apply(self, event: Input | CapturedFrame) -> None:
        super().apply(event)
        if self._others is None or not isinstance(event, Push | Carry | Clear | Ground | Restart | Enter):
            return
        if isinstance(event, Restart) or (isinstance(event, Enter) and not event.scenario):
            self._others.begin(float(self._batch.phases[0]), self._batch.target)
        self._others.apply(event)
        self._fell = False

    def advance(self) -> Frame:
        if (others := self._present) is not None:
            others.advance(self._batch.target)
        frame = super().advance()
        self._fell |= frame.fallen
        return frame

    def _frame(self, drag: Array | None) -> Frame:
        frame, others = super()._frame(drag), self._present
        return frame if others is None else replace(frame, companions=others.shown())

    def words(self) -> list[str]:
        lines = super().words()
        if (others := self._present) is not None:
            fell = np.append(others.fell, self._fell)
            lines.append(f"{np.sum(~fell)} of {len(fell)} humanoids have not fallen since the last push")
        return lines

    def close(self) -> None:
        super().close()
        if self._others is not None:
            self._others.close()


class _Batch:
    """The humanoids of a session's companions. fell: (N,) since the last push or other input."""

    def __init__(
        self,
        motion: Motion,
        policy: Policy | None,
        config: EnvConfig,
        engine: str,
        count: int,
        *,
        restart: bool,
    ) -> None:
        self._policy, self._restart, self._cyclic = policy, restart, motion.cyclic
        world = open_world(count, engine)
        self._batch = ImitationBatch(world, reference_for(motion, None), replace(config, scenario=None))
        self._ground = Ground()
        self._effects = [Effects() for _ in range(count)]
        self._shifts: Array = np.zeros((count, 3))  # from a humanoid's own world to the session's
        self._tilts: Array = np.zeros((count, 3))  # what the slope adds to gravity, m/s²
        self._fallen_for = np.zeros(count, dtype=np.int64)  # control steps
        self.fell = np.zeros(count, dtype=np.bool_)

    def begin(self, phase: float, leader: BodyStates) -> None:
        """Put all onto the reference beside the reference of the session's humanoid, which is at a phase."""
        count = len(self._effects)
        phases = phase + np.arange(1, count + 1) / (count + 1)
        self._reset(np.arange(count), phases % 1.0, leader)

    def shift(self, displacement: Array) -> None:
        """Follow the session's humanoid, which was moved by a displacement (3,), m."""
        self._shifts += displacement * [1.0, 1.0, 0.0]

    def apply(self, event: Input) -> None:
        """Take an input."""
        self.fell[:] = False
        if isinstance(event, Push | Carry):
            for index, effects in enumerate(self._effects):
                effects.apply(event, self._one(index))
        elif isinstance(event, Clear):
            self._effects = [Effects(carried=effects.carried) for effects in self._effects]
        elif isinstance(event, Ground):
            self._ground = event
            batch = self._batch
            friction = np.full(len(self._effects), event.friction)
            batch.restore({**batch.snapshot(), "friction": friction})
            self._set_tilts(np.arange(len(self._effects)))

    def advance(self, leader: BodyStates) -> None:
        """One control step."""
        batch = self._batch
        acting = [
            effects.wrenches(self._one(index), tilt)[0]
            for index, (effects, tilt) in enumerate(zip(self._effects, self._tilts, strict=True))
        ]
        wrenches = np.concatenate(acting)
        wrenches[..., :3] += [weights(tilt) for tilt in self._tilts]
        batch.step(policy_actions(self._policy, batch.observe()), wrenches)
        down = (self._fallen_for > 0) | batch.fallen()
        self._fallen_for = np.where(down, self._fallen_for + 1, 0)
        self.fell |= down
        again = (self._fallen_for >= LYING) if self._restart else np.zeros_like(down)
        over = ~down & (batch.phases >= 1.0) if not self._cyclic else np.zeros_like(down)
        if (indices := np.flatnonzero(again | over)).size:
            phases = batch.phases[indices] % 1.0 if self._cyclic else np.zeros(indices.size)
            self._reset(indices, phases, leader)

    def _reset(self, indices: NDArray[np.intp], phases: Array, leader: BodyStates) -> None:
        """Put some onto the reference, each at its place beside the session's humanoid; their pushes end."""
        nominal = RandomizationSample.nominal(len(indices))
        friction = np.full(len(indices), self._ground.friction)
        self._batch.reset(indices, phases, replace(nominal, friction=friction))
        for index in indices:
            self._effects[index] = Effects(carried=self._effects[index].carried)
        self._fallen_for[indices] = 0
        self._set_tilts(indices)
        row, column = np.divmod(indices + 1, ROW)
        grid = np.stack([-BEHIND * row, APART * column, np.zeros(len(indices))], axis=-1)
        places = leader.positions[0, 0] + rotate(heading_turn(leader), grid)
        self._shifts[indices] = (places - self._batch.bodies.positions[indices, 0]) * [1.0, 1.0, 0.0]

    def _set_tilts(self, indices: NDArray[np.intp]) -> None:
        batch, slope = self._batch, self._ground.slope
        for index in indices:
            uphill = heading(batch.reference, float(batch.phases[index])) if slope else 0.0
            self._tilts[index] = slope_tilt(slope, uphill)

    def _one(self, index: int) -> BodyStates:
        """The states of one, as a batch."""
        b, own = self._batch.bodies, slice(index, index + 1)
        return BodyStates(b.positions[own], b.rotations[own], b.linear[own], b.angular[own])

    def shown(self) -> Companions:
        """Where they are in the session's world."""
        bodies = self._batch.bodies
        return Companions(
            positions=bodies.positions + self._shifts[:, None],
            rotations=bodies.rotations.copy(),
            fallen=self._fallen_for > 0,
        )

    def close(self) -> None:
        self._batch.world.close()
