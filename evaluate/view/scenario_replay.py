"""Replay of one scenario trial, with its obstacles and forces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinemimic.evaluate.robustness.scenario_trials import trial_start, trial_steps
from kinemimic.evaluate.view.obstacle_rendering import Disturbances
from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.rollout import record_trajectory
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.scenario.event_schedule import draw_event_schedule
from kinemimic.train.scenario.route import reference_for
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.env import ImitationBatch


def replay_scenario(
    motion: Motion,
    policy: Policy,
    config: TrainConfig,
    scenario: Scenario,
    *,
    number: int = 0,
    seed: int = 0,
    engine: str = "auto",
) -> tuple[Trajectory, Disturbances]:
    """Trial `number` of `disturb` with that seed, on its own and continued after a fall."""
    reference, steps = reference_for(motion, scenario), trial_steps(motion, scenario)
    trial_seed, phase = trial_start(motion, scenario, seed, number)
    task = replace(config.measured_env, scenario=scenario)
    batch = ImitationBatch(open_world(1, engine, measure_torques=True), reference, task)
    batch.reset(np.array([0]), np.array([phase]), seeds=np.array([trial_seed], dtype=np.uint64))
    schedule = draw_event_schedule(scenario, reference, phase, np.random.default_rng(trial_seed))
    states = np.full((steps, len(schedule.releases), 13), np.nan)
    loads = np.zeros((steps, len(BODIES), 3))

    def record(step: int) -> None:
        there = batch.world.obstacles(0)
        states[step, : len(there)] = there
        loads[step] = 0.0 if batch.wrenches is None else batch.wrenches[0, :, :3]

    played = record_trajectory(batch, policy, np.array([phase]), steps, record)
    batch.world.close()
    return played, Disturbances([item for _, item in schedule.releases], states, loads)
