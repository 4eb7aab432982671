"""Roll out a policy: the loop that all evaluations share, and trajectories recorded with it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.parallel.task_pool import parallel_map
from kinemimic.retarget.humanoid.body import BODY_NODES
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import BodyStates
from kinemimic.train.task.env import ACTIONS, ImitationBatch

# Actions (E, 42) for observations (E, O).
Act = Callable[[Array], NDArray[Any]]
# Called after a control step with its number and which humanoids (E,) have not fallen yet; True stops.
OnStep = Callable[[int, NDArray[np.bool_]], bool | None]


def roll_out(
    batch: ImitationBatch,
    act: Act | None,
    steps: int | None,
    on_step: OnStep,
    *,
    until_all_fell: bool = True,
    wrenches: Array | None = None,
) -> NDArray[np.int64]:
    """Step a batch with a policy's actions; returns the control step (E,) of each first fall.

    The batch starts in its current state. Without a fall, the step is `steps`. act: None for no corrections
    of the reference; steps: None rolls out until `on_step` stops it; on_step may reset humanoids of the
    batch; until_all_fell: stop before `on_step` once every humanoid has fallen (`ImitationBatch.fallen`), and
    simulate no humanoid beyond its fall; wrenches: (E, 15, 6) external force and torque, read at every step,
    so that `on_step` may change them.
    """
    size = batch.world.size
    last = np.iinfo(np.int64).max if steps is None else steps
    fallen_at = np.full(size, last)
    standing = np.ones(size, dtype=np.bool_)
    observations = batch.observe()
    for step in itertools.count() if steps is None else range(steps):
        actions = np.zeros((size, ACTIONS)) if act is None else act(observations).astype(np.float64)
        observations = batch.step(actions, wrenches).observations
        falls = batch.fallen() & standing
        fallen_at[falls] = step
        standing = standing & ~falls
        if until_all_fell and falls.any():
            if not standing.any():
                break
            batch.world.freeze(np.flatnonzero(falls))
        if on_step(step, standing):
            break
        if not batch.ages.all():  # some were reset
            observations = batch.observe()
    return fallen_at


def collect_trajectories(
    motion: Motion,
    policy: Policy | None,
    config: EnvConfig,
    *,
    start_phases: Array,
    frames: int,
    engine: str = "auto",
    workers: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> Trajectory:
    """Trajectories of the deterministic policy from each start phase, in parallel on `workers` processes.

    policy: None for the PD targets alone; config: the policy's task, also for its control without a policy,
    with the reward to record (`TrainConfig.measured_env`). A rollout continues after a fall. engine: see
    `engines.py`. progress: called with the number of finished rollouts.
    """
    # One humanoid per task: its trajectory must not depend on the number of others.
    tasks = [(motion, policy, config, float(phase), frames, engine) for phase in start_phases]
    return _joined(motion, parallel_map(_collect_one, tasks, workers=workers, progress=progress))


def collect_here(
    motion: Motion, policy: Policy | None, config: EnvConfig, *, start_phases: Array, frames: int, engine: str
) -> Trajectory:
    """`collect_trajectories` in this process, for workers that share many motions."""
    tasks = [(motion, policy, config, float(phase), frames, engine) for phase in start_phases]
    return _joined(motion, [_collect_one(task) for task in tasks])


def _joined(motion: Motion, parts: Sequence[Trajectory]) -> Trajectory:
    """The rollouts of several trajectories in one."""
    shared: dict[str, Any] = {"reward_names": parts[0].reward_names, "motion": motion.identity}
    joined: dict[str, Any] = {
        f.name: np.concatenate([getattr(part, f.name) for part in parts])
        for f in fields(Trajectory)
        if f.name not in shared
    }
    return Trajectory(**joined, **shared)


def _collect_one(task: tuple[Motion, Policy | None, EnvConfig, float, int, str]) -> Trajectory:
    motion, policy, config, phase, frames, engine = task
    batch = ImitationBatch(open_world(1, engine, measure_torques=True), Reference(motion), config)
    batch.reset(np.array([0]), np.array([phase]))
    trajectory = record_trajectory(batch, policy, np.array([phase]), frames)
    batch.world.close()
    return trajectory


def record_trajectory(
    batch: ImitationBatch,
    policy: Policy | None,
    phases: Array,
    frames: int,
    on_step: Callable[[int], object] | None = None,
) -> Trajectory:
    """Roll out a batch, which was reset to phases (E,), beyond all falls. Its world measures torques.

    The trajectory of a humanoid does not depend on the others of its batch. on_step: called with the number
    of every control step.
    """
    reference = batch.reference
    rows: dict[str, list[NDArray[Any]]] = {
        name: []
        for name in ("phases", "root", "rotations", "rewards", "torques", "contacts", "contact_forces")
    }

    def record(step: int, _: NDArray[np.bool_]) -> None:
        rows["phases"].append(batch.phases.copy())
        # The engine writes the next step into the same arrays.
        rows["root"].append(batch.bodies.positions[:, 0].copy())
        rows["rotations"].append(node_rotations(batch.bodies))
        rows["rewards"].append(batch.terms())
        rows["torques"].append(batch.world.peak_torques().copy())
        rows["contacts"].append(batch.world.contacts())
        rows["contact_forces"].append(batch.world.contact_forces())
        if on_step is not None:
            on_step(step)

    act = None if policy is None else policy.act_one_by_one
    fallen_at = roll_out(batch, act, frames, record, until_all_fell=False)
    stacked = {name: np.stack(values, axis=1) for name, values in rows.items()}
    return Trajectory(
        start_phases=phases,
        reference_root=reference.root(stacked["phases"]),
        reference_rotations=reference.nodes(stacked["phases"]),
        reward_names=np.array(list(batch.reward.weights)),
        fallen_at=fallen_at,
        phases=stacked["phases"],
        root=stacked["root"],
        rotations=stacked["rotations"],
        rewards=stacked["rewards"],
        torques=stacked["torques"],
        contacts=stacked["contacts"].astype(np.bool_),
        contact_forces=stacked["contact_forces"],
    )


def node_rotations(bodies: BodyStates) -> Array:
    """Local rotations (E, 20, 4) of the skeleton's nodes."""
    nodes = np.tile(IDENTITY, (len(bodies.rotations), len(NODES), 1))
    nodes[:, BODY_NODES[0]] = bodies.rotations[:, 0]
    nodes[:, BODY_NODES[1:]] = bodies.joints
    return nodes
