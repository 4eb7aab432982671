"""A humanoid that performs a motion while people push it: deterministic in its inputs and their steps.

A session knows neither clock nor page: the same inputs before the same control steps give the same states to
the last bit, on the same engine.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kinemimic.evaluate.robustness.scenario_trials import trial_start
from kinemimic.evaluate.simulate.session.effects import Effects, weights
from kinemimic.evaluate.simulate.session.frame import Frame, LiveSettings, LiveView, Score
from kinemimic.evaluate.simulate.session.inputs import (
    Carry,
    Clear,
    Drag,
    Enter,
    Ground,
    Input,
    Push,
    Release,
    Restart,
    Throw,
)
from kinemimic.evaluate.simulate.session.obstacles import Obstacles, thrown_by
from kinemimic.evaluate.simulate.session.score_window import ScoreWindow
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.live.frame import CapturedFrame
from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.reference.heading import heading
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.rollout import node_rotations
from kinemimic.train.scenario.event_schedule import draw_event_schedule, slope_tilt
from kinemimic.train.scenario.route import reference_for
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE, BodyStates
from kinemimic.train.task.domain_randomization import RandomizationSample
from kinemimic.train.task.env import ACTIONS, ImitationBatch

LYING = 2 * CONTROL_RATE  # control steps on the ground before an automatic restart


class Session:
    """One humanoid with a policy on a motion.

    restart: whether it is put back onto its reference after a fall; live: settings of the live capture that
    drives the session, None without one.
    """

    live: LiveSettings | None = None

    def __init__(
        self,
        motion: Motion,
        policy: Policy | None,
        config: EnvConfig,
        engine: str,
        *,
        restart: bool = True,
        scenario_named: Callable[[str], Scenario] | None = None,
    ) -> None:
        self.motion, self.policy = motion, policy
        self.step_count, self.falls, self.restart = 0, 0, restart
        self._config, self._engine = config, engine
        self._scenario_named = scenario_named
        self._ground = Ground()
        self._effects = Effects()
        self._window = ScoreWindow()
        self._seed, self._start = 0, 0.0  # of the trial
        self._batch = self._opened(None, self._reference(None))
        self._obstacles = Obstacles(self._batch)
        self._reset(0.0)

    def _opened(self, scenario: Scenario | None, reference: Reference) -> ImitationBatch:
        """A new world, in a scenario or in none."""
        config = replace(self._config, scenario=scenario)
        return ImitationBatch(open_world(1, self._engine), reference, config)

    def _reference(self, scenario: Scenario | None) -> Reference:
        """What is performed, in a scenario or in none."""
        return reference_for(self.motion, scenario)

    def _restart_phase(self) -> float:
        """Where a humanoid that fell is put back."""
        if self._batch.config.scenario is not None:
            return self._start
        return float(self._batch.phases[0] % 1.0) if self.motion.cyclic else 0.0

    def _is_over(self) -> bool:
        """Whether the reference has ended."""
        return not self.motion.cyclic and bool(self._batch.phases[0] >= 1.0)

    def _actions(self) -> Array:
        """Actions (1, 42) for the observation."""
        return policy_actions(self.policy, self._observation)

    def _scenario(self, name: str) -> Scenario:
        if self._scenario_named is None:
            raise KinemimicError("expected no scenario: this session knows none")
        return self._scenario_named(name)

    def _enter(self, scenario: Scenario | None, number: int) -> None:
        """Begin a trial of a scenario, the one that `view` shows, or go on without one."""
        seed, phase = (0, 0.0) if scenario is None else trial_start(self.motion, scenario, 0, number)
        reference = self._reference(scenario)
        _require_places(scenario, reference, phase, seed)
        batch = self._opened(scenario, reference)
        self._batch.world.close()
        self._obstacles = Obstacles(batch, first=self._obstacles.numbers.stop)
        self._batch, self._seed, self._start = batch, seed, phase
        self._window.clear()
        self._reset(phase)

    def _reset(self, phase: float) -> None:
        """Put the humanoid onto its reference; pushes end, and thrown obstacles are removed."""
        batch, scenario = self._batch, self._batch.config.scenario
        _require_places(scenario, batch.reference, phase, self._seed)
        self._effects = Effects(carried=self._effects.carried)
        self._obstacles.clear()
        seeds = None if scenario is None else np.array([self._seed], dtype=np.uint64)
        ground = self._ground if scenario is None else Ground()
        sample = replace(RandomizationSample.nominal(1), friction=np.array([ground.friction]))
        batch.reset(np.array([0]), np.array([phase]), sample, seeds)
        self._observation = batch.observe()
        self._fallen_for = 0
        self._outside = np.zeros((len(BODIES), 6))
        self._tilt = self._slope_tilt()
        self._window.move(self._roots())

    def _slope_tilt(self) -> Array:
        """What the slope set on the page, uphill where the reference goes now, adds to gravity: (3,) m/s²."""
        batch = self._batch
        if not self._ground.slope or batch.config.scenario is not None:
            return np.zeros(3)
        return slope_tilt(self._ground.slope, heading(batch.reference, float(batch.phases[0])))

    def _roots(self) -> Array:
        """Positions (2, 3) of the roots of humanoid and reference."""
        return np.stack([self._batch.bodies.positions[0, 0], self._batch.target.positions[0, 0]])

    def _set_friction(self) -> None:
        """Apply the ground's friction: the engine changes it only in a reset, here to the current state."""
        batch = self._batch
        with self._obstacles.kept():
            batch.restore({**batch.snapshot(), "friction": np.array([self._ground.friction])})
        self._observation = batch.observe()

    @property
    def shown(self) -> LiveView | None:
        """What a live capture shows, None without one."""
        return None

    def words(self) -> list[str]:
        """Further lines about the session, for the page."""
        return []

    def apply(self, event: Input | CapturedFrame) -> None:
        """Take an input, before the next control step. KinemimicError if it does not fit the session, which
        is then unchanged."""
        if isinstance(event, CapturedFrame):
            raise KinemimicError("expected no frame: no live capture drives this session")
        if isinstance(event, Restart):
            self._reset(event.phase)
            self._window.clear()
        elif isinstance(event, Enter):
            self._enter(self._scenario(event.scenario) if event.scenario else None, event.trial)
        elif isinstance(event, Ground):
            self._set_ground(event)
        elif isinstance(event, Clear):
            self._effects = Effects(carried=self._effects.carried)
            self._outside = np.zeros((len(BODIES), 6))
            if self._batch.config.scenario is None:  # its own obstacles stay
                self._obstacles.clear()
                self._observation = self._batch.observe()
        elif isinstance(event, Drag | Release | Push | Carry):
            self._effects.apply(event, self._batch.bodies)
        else:
            self._throw(event)

    def _set_ground(self, ground: Ground) -> None:
        self._require_free()
        if ground.slope and self._obstacles.can_move:
            raise KinemimicError("expected no slope where an obstacle can move: remove the obstacles first")
        self._ground = ground
        self._set_friction()
        self._tilt = self._slope_tilt()

    def _throw(self, event: Throw) -> None:
        self._require_free()
        if event.mass > 0.0 and self._ground.slope:
            raise KinemimicError(
                "expected no obstacle that can move where the ground has a slope: set the slope to 0 first"
            )
        self._obstacles.throw(thrown_by(event, self._batch.bodies))
        self._observation = self._batch.observe()  # a policy may observe the obstacle

    def _require_free(self) -> None:
        if self._batch.config.scenario is not None:
            raise KinemimicError("a scenario has its own ground and obstacles: leave it first")

    def advance(self) -> Frame:
        """One control step."""
        batch, tilt = self._batch, self._tilt + self._batch.scheduled_tilt(0)
        wrenches, drag = self._effects.wrenches(batch.bodies, tilt)
        wrenches[0, :, :3] += weights(self._tilt)  # a scenario's slope acts by itself
        self._observation = batch.step(self._actions(), wrenches).observations
        self.step_count += 1
        if batch.wrenches is not None:
            self._outside = batch.wrenches[0].copy()
            self._outside[:, :3] -= weights(tilt)
        if self._fallen_for or batch.fallen()[0]:
            self.falls += self._fallen_for == 0
            self._fallen_for += 1
        frame = self._frame(drag)
        self._window.add(frame, self._roots())
        if frame.fallen:
            if self.restart and self._fallen_for >= LYING:
                self._reset(self._restart_phase())
        elif self._is_over():
            self._reset(0.0)
        return frame

    def look(self) -> Frame:
        """The state after the last control step, with what inputs have changed since."""
        return self._frame(self._effects.spring(self._batch.bodies))

    def _frame(self, drag: Array | None) -> Frame:
        batch = self._batch
        moved, wanted = node_rotations(batch.bodies)[0], batch.reference.nodes(batch.phases)[0]
        angles, expected = (
            {name: float(curve[0]) for name, curve in joint_angles(rotations[None]).items()}
            for rotations in (moved, wanted)
        )
        return Frame(
            step=self.step_count,
            phase=float(batch.phases[0]),
            bodies=_first(batch.bodies),
            target=_first(batch.target),
            contacts=batch.world.contact_forces()[0].copy(),
            loads=self._outside[:, :3].copy(),
            torques=self._outside[:, 3:].copy(),
            tilt=self._tilt + batch.scheduled_tilt(0),
            drag=drag,
            dragged=self._effects.dragged,
            obstacles=tuple(self._obstacles.present),
            states=batch.world.obstacles(0).copy(),
            numbers=tuple(self._obstacles.numbers),
            rotations=moved,
            reference_rotations=wanted,
            angles=angles,
            wanted=expected,
            terms=dict(zip(batch.reward.weights, batch.terms()[0].tolist(), strict=True)),
            fallen=self._fallen_for > 0,
            shown=self.shown,
        )

    def score(self) -> Score | None:
        """Of the last ten seconds since a person's last restart; None in the first of them."""
        return self._window.score()

    def digest(self) -> str:
        """16 digits that two sessions share if their states are equal to the last bit."""
        b = self._batch.bodies
        arrays = (b.positions, b.rotations, b.linear, b.angular, self._batch.phases)
        return hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)).hexdigest()[:16]

    def close(self) -> None:
        """Free the engine."""
        self._batch.world.close()


def policy_actions(policy: Policy | None, observations: Array) -> Array:
    """Actions (E, 42) for observations (E, O): without a policy, no corrections of the reference."""
    if policy is None:
        return np.zeros((len(observations), ACTIONS))
    return policy.act(observations).astype(np.float64)


def _require_places(scenario: Scenario | None, reference: Reference, phase: float, seed: int) -> None:
    """KinemimicError if a trial of a scenario has no place for an obstacle."""
    if scenario is not None:
        draw_event_schedule(scenario, reference, phase, np.random.default_rng(seed))


def _first(bodies: BodyStates) -> BodyStates:
    """Copies of the states of the first humanoid: the engine writes the next step into the same memory."""
    parts = (bodies.positions, bodies.rotations, bodies.linear, bodies.angular)
    return BodyStates(*(part[0].copy() for part in parts))
