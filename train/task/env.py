"""The imitation task on a batch of environments: observation, action, reward, termination."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import IDENTITY, conjugate, from_rotvec, multiplier, rotate
from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.scenario.clutter import CLUTTER
from kinemimic.train.scenario.scenario_manager import ScenarioManager
from kinemimic.train.sim.world import (
    CONTROL_RATE,
    JOINT_PARENTS,
    SUBSTEPS,
    TIME_STEP,
    BodyStates,
    Obstacle,
    Poses,
    World,
)
from kinemimic.train.task.balance import balance_turns
from kinemimic.train.task.domain_randomization import RandomizationSample
from kinemimic.train.task.hurry import hurry
from kinemimic.train.task.mirror import Mirror, mirrored, reflected_rows
from kinemimic.train.task.observation import observe
from kinemimic.train.task.obstacle_observation import obstacle_states
from kinemimic.train.task.reward import pose_turns, rewards
from kinemimic.train.task.timer import Timer

JOINTS = len(BODIES) - 1
ACTIONS = 3 * JOINTS
# Radians of correction per unit of action: legs and trunk keep the balance, the arms only hang.
_REACH = {
    "torso": 1.0,
    "head": 0.1,
    "upper_arm": 0.1,
    "forearm": 0.1,
    "hand": 0.03,
    "thigh": 1.0,
    "shin": 1.0,
    "foot": 1.0,
}
ACTION_SCALE: Array = np.repeat(
    [_REACH[body.name.removesuffix("_left").removesuffix("_right")] for body in BODIES[1:]], 3
)
# Of the actions: the ankles.
ANKLES = [k for k in range(ACTIONS) if BODIES[1 + k // 3].name.startswith("foot")]
_SUBSTEP_TIMES: Array = np.arange(1.0, SUBSTEPS + 1) * TIME_STEP
# Names of the timer for the parts of a control step (`timer.py`).
SIMULATION = "simulation"
TASK = "observation and reward"
# A humanoid has fallen when its pelvis deviates this much from the reference, in height or rotation: the same
# for every policy, regardless of what terminates the episodes of its training.
FALL_HEIGHT = 0.25  # m
FALL_TURN = 1.0  # rad


@dataclass(frozen=True)
class Step:
    """Result of a control step for E environments.

    observations: (E, O) of `observation_size`, after the step, before any reset; terms: (E, K) reward terms;
    terminated: (E,) fell, drifted off the reference or exploded; truncated: (E,) the time limit, not a fall;
    exploded: (E,) the state became invalid, and the engine holds the last valid one.
    """

    observations: Array
    terms: Array
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    exploded: NDArray[np.bool_]


class ImitationBatch:
    """E environments that imitate one reference. The time of each is its phase in the reference, not wrapped.

    bodies: simulated, views of the world's arrays, valid until the next step or reset; target: the reference
    now; wrenches: (E, 15, 6) force and torque on the bodies in the last step, or None; timer: wall time by
    part.
    """

    def __init__(self, world: World, reference: Reference, config: EnvConfig) -> None:
        self.world = world
        self.reference = reference
        self.config = config
        self.reward = config.reward  # may be changed between steps, as may this:
        self.max_body_error = float("inf") if config.tracking is None else config.tracking.max_body_error
        self.wrenches: Array | None = None
        self.timer = Timer()
        self.phases: Array = np.zeros(world.size)
        self.ages = np.zeros(world.size, dtype=np.int64)  # control steps since the reset
        self._randomization = RandomizationSample.nominal(world.size)
        scenario = config.scenario or (CLUTTER if config.domain_randomization.obstacles else None)
        self._scenario_manager = None if scenario is None else ScenarioManager(scenario, reference, world)
        self._last_action: Array = np.zeros((world.size, ACTIONS))
        self._scale = ACTION_SCALE if config.residual else np.ones(ACTIONS)
        self._mirror = Mirror(config) if mirrored(config, reference) else None
        self.bodies: BodyStates = world.states()
        self._update_target(reference.bodies(self.phases))

    def _update_target(self, target: BodyStates) -> None:
        """Compare the current states with the target and the poses of the preview."""
        self.target = target
        self._exploded = self.world.exploded()
        increment = self._increment
        self._ahead = [self.reference.bodies(self.phases + k * increment) for k in self.config.preview]
        self._turns, *self._turns_ahead = pose_turns(self.bodies, self.target, *self._ahead)
        if self._mirror is not None:
            self._reflected = reflected_rows(self.config, self.phases, target)

    @property
    def _increment(self) -> Array | float:
        """Phase of a control step, (E,) where motions differ."""
        return 1.0 / (CONTROL_RATE * self.reference.duration)

    def reset(
        self,
        indices: NDArray[np.intp],
        phases: Array,
        randomization: RandomizationSample | None = None,
        seeds: NDArray[np.uint64] | None = None,
    ) -> None:
        """Start environments (N,) on the reference at phases (N,), with their randomization.

        seeds: (N,) of the events of the configuration's scenario; without seeds, there are none.
        """
        randomization = randomization or RandomizationSample.nominal(len(indices))
        self.phases[indices] = phases
        self.ages[indices] = 0
        self._last_action[indices] = 0.0
        self._randomization.assign(indices, randomization)
        poses = randomization.perturbed(self.reference.of(indices).poses(phases))
        if self._scenario_manager is not None:
            self._begin_events(self._scenario_manager, indices, phases, randomization.clutter, seeds)
        self.timer.lap(TASK)
        self._place(indices, poses)

    def _begin_events(
        self,
        manager: ScenarioManager,
        indices: NDArray[np.intp],
        phases: Array,
        clutter: NDArray[np.uint64],
        seeds: NDArray[np.uint64] | None,
    ) -> None:
        """Begin the scenario's events, or those of the randomization."""
        if self.config.scenario is not None:
            manager.begin(indices, phases, seeds)
            return
        among = clutter > 0
        manager.begin(indices[among], phases[among], clutter[among])
        manager.begin(indices[~among], phases[~among], None)

    def _place(self, indices: NDArray[np.intp], poses: Poses) -> None:
        friction = self._randomization.friction[indices]
        if self._scenario_manager is not None:
            friction = self._scenario_manager.friction(indices, friction)
        self.world.vary(indices, friction, self._randomization.mass[indices])
        self.world.reset(indices, poses)
        self.bodies = self.world.states()
        self.timer.lap(SIMULATION)
        target = self.reference.bodies(self.phases)
        if self.config.hurry:
            # The others stay compared with the pose that their last step aimed at.
            others = np.setdiff1d(np.arange(self.world.size), indices)
            target = target.with_rows(others, self.target)
        self._update_target(target)

    def scheduled_obstacles(self, index: int) -> list[Obstacle] | None:
        """The obstacles of the scenario that an environment has now, None without a scenario."""
        manager = self._scenario_manager
        if manager is None or self.config.scenario is None:
            return None
        return manager.present(index, int(self.ages[index]))

    def scheduled_tilt(self, index: int) -> Array:
        """What the slope of an environment's scenario adds to gravity, (3,) m/s²; 0 without a scenario."""
        manager = self._scenario_manager
        return np.zeros(3) if manager is None else manager.tilt(index)

    def snapshot(self) -> dict[str, NDArray[Any]]:
        """The complete state for `restore`, arrays (E, ...)."""
        b = self.bodies
        spins = b.angular[:, 1:] - b.angular[:, JOINT_PARENTS]
        persistent = self._randomization.persistent()
        return {
            "phases": self.phases.copy(),
            "ages": self.ages.copy(),
            "last_action": self._last_action.copy(),
            "root": b.positions[:, 0].copy(),
            "root_rotation": b.rotations[:, 0].copy(),
            "root_linear": b.linear[:, 0].copy(),
            "root_angular": b.angular[:, 0].copy(),
            "joints": b.joints,
            "joint_velocities": rotate(conjugate(b.rotations[:, 1:]), spins),
            **{name: value.copy() for name, value in persistent.items()},
            **({} if self._scenario_manager is None else self._scenario_manager.snapshot()),
        }

    def restore(self, snapshot: Mapping[str, NDArray[Any]]) -> None:
        """Set all environments to a snapshot. This clears the engine's contacts and warm starts: two batches
        that start from the same snapshot stay equal to the last bit."""
        self.phases = snapshot["phases"].copy()
        self.ages = snapshot["ages"].copy()
        self._last_action = snapshot["last_action"].copy()
        persistent = self._randomization.persistent()
        self._randomization = replace(
            self._randomization, **{name: snapshot[name].copy() for name in persistent}
        )
        if self._scenario_manager is not None:
            self._scenario_manager.restore(snapshot, self.ages)
        poses = Poses(**{f.name: snapshot[f.name] for f in fields(Poses)})
        self._place(np.arange(self.world.size), poses)

    def step(self, actions: Array, wrenches: Array | None = None) -> Step:
        """One control step with actions (E, 42): corrections of the reference's joints as rotation vectors;
        in the second half of a mirrored cycle they are those of the mirror image (`mirror.py`)."""
        actions = self.reflected(actions)
        if self.config.balance:
            actions += balance_turns(self.bodies, self.target).reshape(-1, ACTIONS) / self._scale
        at = self.phases[:, None] + _SUBSTEP_TIMES / np.reshape(self.reference.duration, (-1, 1))
        joints, velocities = self._targets(at)
        # One correction for the targets of all substeps: products of 8 x 4 and 4 x 4 matrices.
        targets = np.empty(joints.shape)
        np.matmul(joints.swapaxes(1, 2), self._correction(actions), out=targets.swapaxes(1, 2))
        late = np.arange(SUBSTEPS) < self._randomization.delay[:, None]  # (E, SUBSTEPS)
        if late.any():
            before = joints.swapaxes(1, 2) @ self._correction(self._last_action)
            targets[late] = before.swapaxes(1, 2)[late]
            self._last_action = np.array(actions, dtype=np.float64)
        acting = [wrenches, self._randomization.pushes(self.ages)]
        if self._scenario_manager is not None:
            acting.append(self._scenario_manager.act(self.ages, self._randomization.mass))
        found = [one for one in acting if one is not None]
        wrenches = self.wrenches = sum(found[1:], found[0]) if found else None
        self.timer.lap(TASK)
        self.bodies = self.world.step(targets, velocities, wrenches)
        self.timer.lap(SIMULATION)
        pace = hurry(self.bodies, self.target) if self.config.hurry else 1.0
        # The step aimed at the pose one increment on, and is compared with it; a hurry begins after it.
        aimed = self._ahead[0]
        if self.config.preview[0] != 1:
            aimed = self.reference.bodies(self.phases + self._increment)
        self.phases = self.phases + pace * self._increment
        self.ages += 1
        self._update_target(aimed)
        terminated = self.terminated()
        truncated = ~terminated & (self.ages >= self.config.steps)
        truncated |= ~terminated & ~np.asarray(self.reference.cyclic) & (self.phases >= 1.0)
        terms = np.where(terminated[:, None], 0.0, self.terms())
        return Step(self.observe(), terms, terminated, truncated, self._exploded)

    def _targets(self, at: Array) -> tuple[Array, Array]:
        """Targets of the stable PD before the action: rotations (..., 14, 4), velocities (..., 14, 3)."""
        config, reference = self.config, self.reference
        joints, velocities = reference.targets(at) if config.torque_feedforward else reference.joints(at)
        if not config.residual:
            joints = np.broadcast_to(IDENTITY, joints.shape)
        return joints, velocities if config.velocity_feedforward else np.zeros_like(velocities)

    def _correction(self, actions: Array) -> Array:
        """Right factors (E, 14, 4, 4) of the corrections of actions (E, 42)."""
        return multiplier(from_rotvec((actions * self._scale).reshape(-1, JOINTS, 3)))

    def terms(self) -> Array:
        """Reward terms (E, K) of the current states, fallen or not."""
        return rewards(self.bodies, self.target, self._turns, self.reward)

    def fallen(self) -> NDArray[np.bool_]:
        """(E,) exploded, or the pelvis too low, too high or rotated too far from its reference."""
        return self._off_reference(FALL_HEIGHT, FALL_TURN)

    def terminated(self) -> NDArray[np.bool_]:
        """(E,) whether the episode ends: beyond the configuration's errors of height, rotation or path."""
        way = self.bodies.positions[:, 0] - self.target.positions[:, 0]
        far = np.hypot(way[:, 0], way[:, 1]) > self.config.max_drift
        if self.config.tracking is not None:
            distances = np.linalg.norm(self.bodies.positions - self.target.positions, axis=-1)
            far |= distances.mean(axis=-1) > self.max_body_error
        return far | self._off_reference(self.config.max_height_error, self.config.max_rotation_error)

    def _off_reference(self, height: float, turn: float) -> NDArray[np.bool_]:
        off = np.abs(self.bodies.positions[:, 0, 2] - self.target.positions[:, 0, 2])
        turned = np.einsum("ei,ei->e", self._turns[:, 0], self._turns[:, 0])
        return np.asarray((off > height) | (turned > turn**2) | self._exploded)

    @property
    def turns(self) -> Array:
        """(E, 15, 3) rotation vectors from the simulated pose to the target's (`reward.pose_turns`), rad."""
        turns: Array = self._turns
        return turns

    def reflected(self, actions: Array) -> Array:
        """Actions (E, 42) as `step` takes them from a policy: reflected where the policy sees the mirror
        image."""
        actions = np.array(actions, dtype=np.float64)
        if self._mirror is not None:
            self._mirror.actions(actions, self._reflected)
        return actions

    def observe(self) -> Array:
        """(E, O) of `observation.observe`, in the second half of a mirrored cycle reflected (`mirror.py`)."""
        observations = observe(
            self.config,
            self.phases,
            self.reference.cyclic,
            self.bodies,
            self.target,
            self._ahead,
            self._turns,
            self._turns_ahead,
            obstacle_states(self.world) if self.config.observed_obstacles else None,
        )
        if self._mirror is not None:
            self._mirror.observations(observations, self._reflected)
        return observations
