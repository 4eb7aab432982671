"""Let a policy perform: rollouts from given phases that do not stop at a fall."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import IDENTITY
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.pipeline.parallel.task_pool import parallel_map
from kinemimic.retarget.humanoid.body import BODY_NODES
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import EnvConfig, TrainConfig
from kinemimic.train.reference.reference import Reference
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.engines import open_world
from kinemimic.train.sim.world import BodyStates
from kinemimic.train.task.env import ACTIONS, ImitationBatch


def collect_trajectories(
    motion: Motion,
    policy: Path | None,
    *,
    start_phases: Array,
    frames: int,
    engine: str = "auto",
    workers: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> Trajectory:
    """Rollouts of the deterministic policy from each phase, side by side on `workers` processes.

    policy: file of a trained policy, or None for the reference's PD targets alone. A fall is noted and the
    figure lies there while the reference goes on. engine: of `engines.py`.
    progress: called with the number of phases that are done.
    """
    actor, config = None, EnvConfig()
    if policy is not None:
        actor, record = Policy.load(policy)
        config = TrainConfig.from_json(record["config"]).env
    # One figure a task: what a figure does must not depend on how many others there are.
    tasks = [(motion, actor, config, float(phase), frames, engine) for phase in start_phases]
    parts = parallel_map(_perform_one, tasks, workers=workers, progress=progress)
    joined: dict[str, Any] = {
        f.name: parts[0].reward_names
        if f.name == "reward_names"
        else np.concatenate([getattr(part, f.name) for part in parts])
        for f in fields(Trajectory)
    }
    return Trajectory(**joined)


def _perform_one(task: tuple[Motion, Policy | None, EnvConfig, float, int, str]) -> Trajectory:
    motion, policy, config, phase, frames, engine = task
    batch = ImitationBatch(open_world(1, engine, measure_torques=True), Reference(motion), config)
    batch.reset(np.array([0]), np.array([phase]))
    played = record_trajectory(batch, policy, phase, frames)
    batch.world.close()
    return played


def record_trajectory(
    batch: ImitationBatch,
    policy: Policy | None,
    phase: float,
    frames: int,
    each: Callable[[], object] | None = None,
) -> Trajectory:
    """What the one figure of a batch does from now on; it began at a phase. A fall is noted, and the figure
    lies there while the reference goes on.

    each: called after every control step.
    """
    reference = batch.reference
    observation = batch.observe()
    rows: dict[str, list[NDArray[Any]]] = {
        name: []
        for name in ("phases", "root", "rotations", "rewards", "torques", "contacts", "contact_forces")
    }
    fallen_at = frames
    for frame in range(frames):
        action = np.zeros((1, ACTIONS))
        if policy is not None:
            action = policy.act(observation).astype(np.float64)
        observation = batch.step(action).observations
        if fallen_at == frames and batch.fallen()[0]:
            fallen_at = frame
        rows["phases"].append(batch.phases.copy())
        # The engine writes the next step into the same arrays.
        rows["root"].append(batch.bodies.positions[:, 0].copy())
        rows["rotations"].append(node_rotations(batch.bodies))
        rows["rewards"].append(batch.terms())
        rows["torques"].append(batch.world.peak_torques().copy())
        rows["contacts"].append(batch.world.contacts())
        rows["contact_forces"].append(batch.world.contact_forces())
        if each is not None:
            each()
    stacked = {name: np.stack(values, axis=1) for name, values in rows.items()}
    return Trajectory(
        start_phases=np.array([phase]),
        reference_root=reference.root(stacked["phases"]),
        reference_rotations=reference.nodes(stacked["phases"]),
        reward_names=np.array(list(batch.reward.weights)),
        fallen_at=np.array([fallen_at]),
        phases=stacked["phases"],
        root=stacked["root"],
        rotations=stacked["rotations"],
        rewards=stacked["rewards"],
        torques=stacked["torques"],
        contacts=stacked["contacts"].astype(np.bool_),
        contact_forces=stacked["contact_forces"],
    )


def node_rotations(bodies: BodyStates) -> Array:
    """Local rotations (E, 20, 4) of the nodes from the simulated bodies."""
    nodes = np.tile(IDENTITY, (len(bodies.rotations), len(NODES), 1))
    nodes[:, BODY_NODES[0]] = bodies.rotations[:, 0]
    nodes[:, BODY_NODES[1:]] = bodies.joints
    return nodes
