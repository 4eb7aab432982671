"""A humanoid that performs a motion while people push it: deterministic in its inputs and their steps.

A session knows neither clock nor page: the same inputs before the same control steps give the same states to
the last bit, on the same engine.
"""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kinemimic.evaluate.simulate.effects import Effects, heading_turn, slope_tilt, weights
from kinemimic.evaluate.simulate.frame import Frame, LiveSettings, Score
from kinemimic.evaluate.simulate.inputs import (
    Carry,
    Clear,
    Drag,
    Enter,
    Ground,
    Input,
    Push,
    Release,
    Restart,
)
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.gait.curve_metrics import joint_fits
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.pipeline.live.frame import CapturedFrame
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.rollout import node_rotations
from kinemimic.train.scenario.event_schedule import with_states
from kinemimic.train.scenario.route import reference_for
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import CONTROL_RATE, BodyStates, Obstacle
from kinemimic.train.task.domain_randomization import RandomizationSample
from kinemimic.train.task.env import ACTIONS, ImitationBatch

WINDOW = 10 * CONTROL_RATE  # control steps of the score
MIN_SCORED = CONTROL_RATE
LYING = 2 * CONTROL_RATE  # control steps on the ground before an automatic restart
MAX_OBSTACLES = 20


class Session:
    """One humanoid with a policy on a motion; `restart`: puts it back onto its reference after a fall; live:
    of a session that a live capture drives."""

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
        self._recent: deque[tuple[Array, Array, bool, Array, Array]] = deque(maxlen=WINDOW)
        self._batch = self._opened(None)
        self._begin(None, 0)

    def _opened(self, scenario: Scenario | None) -> ImitationBatch:
        """A new world, in a scenario or in none."""
        config = replace(self._config, scenario=scenario)
        return ImitationBatch(open_world(1, self._engine), self._reference(scenario), config)

    def _reference(self, scenario: Scenario | None) -> Reference:
        """What is performed, in a scenario or in none."""
        return reference_for(self.motion, scenario)

    def _restart_phase(self) -> float:
        """Where a humanoid that fell is put back."""
        return float(self._batch.phases[0] % 1.0) if self.motion.cyclic else 0.0

    def _is_over(self) -> bool:
        """Whether the reference has ended."""
        return not self.motion.cyclic and bool(self._batch.phases[0] >= 1.0)

    def _actions(self) -> Array:
        """Actions (1, 42) for the observation."""
        if self.policy is None:
            return np.zeros((1, ACTIONS))
        return self.policy.act(self._observation).astype(np.float64)

    def _enter(self, scenario: Scenario | None, seed: int) -> None:
        before, self._batch = self._batch, self._opened(scenario)
        before.world.close()
        self._begin(scenario, seed)

    def _begin(self, scenario: Scenario | None, seed: int) -> None:
        self._seed, self._obstacles = seed, list[Obstacle]()
        self._reset(0.0 if scenario is None else float(scenario.phase.low[0]))

    def _reset(self, phase: float) -> None:
        batch = self._batch
        seeds = None if batch.config.scenario is None else np.array([self._seed], dtype=np.uint64)
        self._effects = Effects(carried=self._effects.carried)
        if seeds is None:
            self._obstacles = []
            batch.world.place(0, [])
        sample = replace(RandomizationSample.nominal(1), friction=np.array([self._ground.friction]))
        batch.reset(np.array([0]), np.array([phase]), sample, seeds)
        self._observation = batch.observe()
        self._fallen_for = 0
        self._recent.clear()

    def _set_friction(self) -> None:
        """The engine changes friction with a reset only: one onto the state that it has."""
        batch = self._batch
        self._obstacles = with_states(self._obstacles, batch.world.obstacles(0))
        batch.restore({**batch.snapshot(), "friction": np.array([self._ground.friction])})
        batch.world.place(0, self._obstacles)
        self._observation = batch.observe()

    def words(self) -> list[str]:
        """What else is to be said of the session, in lines."""
        return []

    def apply(self, found: Input | CapturedFrame) -> None:
        """Take an input, before the next control step; KinemimicError if it does not fit the session."""
        if isinstance(found, CapturedFrame):
            raise KinemimicError("expected no frame: no live capture drives this session")
        if isinstance(found, Restart):
            self._reset(found.phase)
        elif isinstance(found, Enter):
            if self._scenario_named is None and found.scenario:
                raise KinemimicError("expected no scenario, found that this session knows none")
            named = self._scenario_named
            self._enter(named(found.scenario) if named and found.scenario else None, found.seed)
        elif isinstance(found, Ground):
            self._require_free()
            self._ground = found
            self._set_friction()
        elif isinstance(found, Clear):
            self._effects = Effects(carried=self._effects.carried)
            if self._batch.config.scenario is None:  # its own obstacles stay
                self._obstacles = []
                self._batch.world.place(0, [])
        elif isinstance(found, Drag | Release | Push | Carry):
            self._effects.apply(found, self._batch.bodies)
        else:
            self._require_free()
            turn, below = (
                heading_turn(self._batch.bodies),
                self._batch.bodies.positions[0, 0] * [1.0, 1.0, 0.0],
            )
            obstacle = Obstacle(
                shape=found.shape,
                size=found.size,
                position=tuple((below + rotate(turn, np.array(found.position))).tolist()),
                rotation=tuple(turn.tolist()),
                mass=found.mass,
                velocity=tuple(rotate(turn, np.array(found.velocity)).tolist()),
            )
            present = with_states(self._obstacles, self._batch.world.obstacles(0))
            self._obstacles = [*present, obstacle][-MAX_OBSTACLES:]
            self._batch.world.place(0, self._obstacles)

    def _require_free(self) -> None:
        if self._batch.config.scenario is not None:
            raise KinemimicError("a scenario has its own ground and obstacles: leave it first")

    def advance(self) -> Frame:
        """One control step."""
        batch = self._batch
        tilt = slope_tilt(batch.bodies, self._ground.slope)
        wrenches, drag = self._effects.wrenches(batch.bodies, tilt)
        self._observation = batch.step(self._actions(), wrenches).observations
        self.step_count += 1
        fallen = bool(batch.fallen()[0]) or self._fallen_for > 0
        moved, wanted = node_rotations(batch.bodies)[0], batch.reference.nodes(batch.phases)[0]
        roots = batch.bodies.positions[0, 0].copy(), batch.target.positions[0, 0].copy()
        self._recent.append((moved, wanted, not fallen, *roots))
        frame = self._frame(moved, wanted, tilt + batch.scheduled_tilt(0), drag, fallen=fallen)
        if fallen:
            self.falls += self._fallen_for == 0
            self._fallen_for += 1
            if self.restart and self._fallen_for >= LYING:
                self._reset(self._restart_phase())
        elif self._is_over():
            self._reset(0.0)
        return frame

    def _frame(self, moved: Array, wanted: Array, tilt: Array, drag: Array | None, *, fallen: bool) -> Frame:
        batch = self._batch
        angles, expected = (
            {name: float(curve[0]) for name, curve in joint_angles(rotations[None]).items()}
            for rotations in (moved, wanted)
        )
        states = batch.world.obstacles(0)
        wrenches = np.zeros((15, 6)) if batch.wrenches is None else batch.wrenches[0].copy()
        return Frame(
            step=self.step_count,
            phase=float(batch.phases[0]),
            bodies=_first(batch.bodies),
            target=_first(batch.target),
            contacts=batch.world.contact_forces()[0].copy(),
            loads=wrenches[:, :3] - weights(tilt),
            torques=wrenches[:, 3:],
            tilt=tilt,
            drag=drag,
            obstacles=tuple(self.present()),
            states=states.copy(),
            rotations=moved,
            reference_rotations=wanted,
            angles=angles,
            wanted=expected,
            terms=dict(zip(batch.reward.weights, batch.terms()[0].tolist(), strict=True)),
            fallen=fallen,
        )

    def present(self) -> list[Obstacle]:
        """The obstacles that are there, a scenario's or a person's."""
        scheduled = self._batch.scheduled_obstacles(0)
        return self._obstacles if scheduled is None else scheduled

    def score(self) -> Score | None:
        """Of the last WINDOW control steps; None before MIN_SCORED of them."""
        if len(self._recent) < MIN_SCORED:
            return None
        moved, wanted, upright, roots, targets = (
            np.array(column) for column in zip(*self._recent, strict=True)
        )
        fits = joint_fits(joint_angles(wanted), joint_angles(moved), upright)
        way, path = (np.linalg.norm((r[-1] - r[0])[:2]) for r in (roots, targets))
        return Score(
            frames=len(upright),
            upright=int(upright.sum()),
            knee=fits["knee"].both.r2_upright,
            hip=fits["hip"].both.r2_upright,
            speed=float(way / path) if path > 0.05 else float("nan"),
        )

    def digest(self) -> str:
        """16 digits that two sessions share if their states are equal to the last bit."""
        b = self._batch.bodies
        arrays = (b.positions, b.rotations, b.linear, b.angular, self._batch.phases)
        return hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)).hexdigest()[:16]

    def close(self) -> None:
        """Free the engine."""
        self._batch.world.close()


def _first(bodies: BodyStates) -> BodyStates:
    """Copies of the states of the first humanoid: the engine writes the next step into the same memory."""
    parts = (bodies.positions, bodies.rotations, bodies.linear, bodies.angular)
    return BodyStates(*(part[0].copy() for part in parts))
