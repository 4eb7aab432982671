"""Knee and hip fit of walks through furnished rooms: the paper's Fig. 12, over several rooms."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice
from typing import Any

import numpy as np

from kinemimic.evaluate.compare.comparison import TrainedPolicy
from kinemimic.evaluate.robustness.scenario_trials import trial_starts, trial_steps
from kinemimic.evaluate.scoring.metrics.scores import FIT_FRAMES, rollout_fits
from kinemimic.pipeline.gait.curve_metrics import SCORED_JOINTS
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.parallel.executor import Executor, ordered_map
from kinemimic.pipeline.parallel.task_pool import parallel_map
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.train.rollout.rollout import record_trajectory
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.scenario.route import reference_for
from kinemimic.train.scenario.scenario import Scenario
from kinemimic.train.sim.engines import open_world
from kinemimic.train.task.env import ImitationBatch

MEASURED = ("r2_upright", "r2", "rmse_deg", "max_gap_deg", "nrmse_fit")


@dataclass(frozen=True)
class Walks:
    """Walks of one policy through random rooms, `trials` of them."""

    trained: TrainedPolicy
    scenario: Scenario
    trials: int
    seed: int
    engine: str


def walk_metrics(walks: Walks) -> list[dict[str, Any]]:
    """Metrics of each walk over its first FIT_FRAMES frames, including those after a fall.

    frames: before a fall; knee, hip: MEASURED, mean of both sides except for the largest gap; gap_side,
    gap_frame: of the largest hip gap, frames counted from 1; curves: angles in degrees, reference and
    simulated.
    """
    played = _walked(walks)
    return [_metrics(played, k) for k in range(walks.trials)]


def _walked(walks: Walks) -> Trajectory:
    """Walk k is trial k of `disturb` with that seed, continued after a fall."""
    motion, config = walks.trained.motion, walks.trained.config
    seeds, phases = trial_starts(motion, walks.scenario, walks.seed, range(walks.trials))
    batch = ImitationBatch(
        open_world(walks.trials, walks.engine, measure_torques=True),
        reference_for(motion, walks.scenario),
        replace(config.measured_env, scenario=walks.scenario),
    )
    batch.reset(np.arange(walks.trials), phases, seeds=seeds)
    steps = min(FIT_FRAMES, trial_steps(motion, walks.scenario))
    played = record_trajectory(batch, walks.trained.policy, phases, steps)
    batch.world.close()
    return played


def _metrics(played: Trajectory, number: int) -> dict[str, Any]:
    """Metrics of one walk."""
    frames = played.root.shape[1]
    fits = rollout_fits(played, number, frames)
    reference = joint_angles(played.reference_rotations[number])
    simulated = joint_angles(played.rotations[number])
    gaps = [np.abs(simulated[f"hip_{side}"] - reference[f"hip_{side}"]) for side in SIDES]
    return {
        "number": number,
        "frames": int(min(played.fallen_at[number], frames)),
        "of": frames,
        **{
            joint: {name: round(getattr(fits[joint].both, name), 6) for name in MEASURED}
            for joint in SCORED_JOINTS
        },
        "gap_side": SIDES[int(np.argmax([gap.max() for gap in gaps]))],
        "gap_frame": int(np.maximum(*gaps).argmax()) + 1,
        "curves": {
            name: {
                "reference": np.degrees(reference[name]).round(2).tolist(),
                "simulated": np.degrees(simulated[name]).round(2).tolist(),
            }
            for name in ANGLES
        },
    }


def rooms(
    algorithms: Sequence[Sequence[TrainedPolicy]],
    scenario: Scenario,
    *,
    trials: int,
    seed: int,
    engine: str,
    workers: int | None = None,
    executor: Executor | None = None,
    progress: Callable[[float], object] | None = None,
) -> list[dict[str, Any]]:
    """Per algorithm, given by its policies (one for each seed of its training): number of walks, number
    without a fall, medians of the fit, and the curves of one walk.

    Walk k of a policy uses the same room for all. shown: the walk where the first algorithm's mean
    `r2_upright` of knee and hip is the median (the lower of the middle two), and for the others the walk of
    their same seed through that room; executor: what runs the tasks, by default `workers` processes of
    this machine; progress: called with the share of walks finished since the last call.
    """
    tasks = [Walks(one, scenario, trials, seed, engine) for policies in algorithms for one in policies]
    share = progress and (lambda k: progress(k / len(tasks)))
    done = iter(
        parallel_map(walk_metrics, tasks, workers=workers, progress=share)
        if executor is None
        else ordered_map(executor, walk_metrics, tasks, progress=share)
    )
    of_all = [list(chain.from_iterable(islice(done, len(policies)))) for policies in algorithms]
    fits = [sum(walk[joint]["r2_upright"] for joint in SCORED_JOINTS) for walk in of_all[0]]
    middle = int(np.argsort(fits, kind="stable")[(len(fits) - 1) // 2])
    return [
        {
            "policy": policies[0].name,
            "trials": len(theirs),
            "upright": sum(walk["frames"] == walk["of"] for walk in theirs),
            **{
                joint: {
                    name: round(float(np.median([walk[joint][name] for walk in theirs])), 6)
                    for name in MEASURED
                }
                for joint in SCORED_JOINTS
            },
            "shown": theirs[middle % len(theirs)],
            "walks": [
                {"seed": k // trials, **{key: value for key, value in walk.items() if key != "curves"}}
                for k, walk in enumerate(theirs)
            ],
        }
        for policies, theirs in zip(algorithms, of_all, strict=True)
    ]
