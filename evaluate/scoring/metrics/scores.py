"""scores.json: metrics of the rollouts, under stable keys.

The headline is the median over all start phases: `survival.frames_median`, and `phases` of `fit`,
`fit_capture`, `tracking` and `root`. The values beside `phases` come from the rollout from phase 0, which the
figures show. Rollouts continue after a fall: the reference moves on, and all frames count, except in
`tracking`. On the ground, the joints can follow their targets easily, so every fit also has `r2_upright`,
which gives no credit after a fall; without a fall it equals `r2`. `torque` is the maximum over all rollouts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from kinemimic.evaluate.scoring.metrics.capture_fit import (
    Capture,
    Rollout,
    adjustments,
    capture_fits,
    truth_fits,
)
from kinemimic.evaluate.scoring.metrics.gait_subjects import reference
from kinemimic.evaluate.scoring.metrics.tracking_error import tracking
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gait.curve_metrics import MEASURES, SCORED_JOINTS, JointFit, joint_fits
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.config.env_config import RewardConfig
from kinemimic.train.rollout.policy import training_summary
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.world import CONTROL_RATE

SCORES_SCHEMA = 2
FIT_FRAMES = 500  # as in the paper
_DECIMALS = 6
# A reference that advances less than this (m), or than this share of its path, stands or returns: there is no
# speed along a line to compare with.
_STANDING, _STRAIGHT = 0.1, 0.5


def survival(trajectory: Trajectory) -> dict[str, float]:
    """Frames before the first fall, from phase 0, in the median and minimum over the start phases, and the
    number of start phases without a fall."""
    frames = trajectory.root.shape[1]
    return {
        "frames": int(min(trajectory.fallen_at[0], frames)),
        "frames_median": float(np.median(np.minimum(trajectory.fallen_at, frames))),
        "frames_min": int(min(trajectory.fallen_at.min(), frames)),
        "of": frames,
        "phases": int(np.sum(trajectory.fallen_at >= frames)),
        "phases_of": len(trajectory.fallen_at),
    }


def rollout_fits(trajectory: Trajectory, rollout: int, frames: int) -> dict[str, JointFit]:
    """Fit of knee and hip to the reference over the first `frames` frames of a rollout."""
    reference = joint_angles(trajectory.reference_rotations[rollout, :frames])
    simulated = joint_angles(trajectory.rotations[rollout, :frames])
    upright = np.arange(len(simulated[ANGLES[0]])) < trajectory.fallen_at[rollout]
    return joint_fits(reference, simulated, upright)


def spread(values: Sequence[float]) -> dict[str, float]:
    """Minimum, median and maximum."""
    return {"min": float(np.min(values)), "median": float(np.median(values)), "max": float(np.max(values))}


def over_phases(rollouts: Sequence[Mapping[str, JointFit]]) -> dict[str, Any]:
    """Fits of one rollout per start phase: the first's by joint and side, and `phases`, their spread."""
    return {
        **{joint: rollouts[0][joint].as_dict() for joint in SCORED_JOINTS},
        "phases": {
            joint: {
                measure: spread([getattr(fits[joint].both, measure) for fits in rollouts])
                for measure in MEASURES
            }
            for joint in SCORED_JOINTS
        },
    }


def fit(trajectory: Trajectory, frames: int) -> dict[str, Any]:
    """Fit to the reference, `over_phases`."""
    rollouts = [rollout_fits(trajectory, k, frames) for k in range(len(trajectory.start_phases))]
    return {**over_phases(rollouts), "frames": min(frames, trajectory.root.shape[1])}


def root_path(trajectory: Trajectory, duration: float | None = None) -> dict[str, Any]:
    """The horizontal path from phase 0; `phases`: spread of each value over all start phases.

    duration: of the motion in s, for a reference that may have hurried (`hurry.py`): its advance, to which
    speed_ratio is relative, is then that at its own speed.

    path_error_m: final distance between humanoid and reference; path_rms_m: its root mean square over time;
    advance_m, reference_advance_m: displacement along the line from the reference's start to its end;
    speed_ratio: their quotient, None if the reference stands or returns; reference_path_m: length of the
    reference's path.
    """
    paces = np.ones(len(trajectory.phases)) if duration is None else _paces(trajectory, duration)
    paths = [
        _path(root[:, :2], reference[:, :2], float(pace))
        for root, reference, pace in zip(trajectory.root, trajectory.reference_root, paces, strict=True)
    ]
    spreads: dict[str, Any] = {}
    for name in ("path_error_m", "speed_ratio"):
        values = [value for path in paths if (value := path[name]) is not None]
        spreads[name] = spread(values) if values else None
    return {**paths[0], "phases": spreads}


def advance_along(went: Array, steps: Array) -> float | None:
    """Metres that a displacement (2,) goes along the reference's line, from its steps (T, 2) in metres; None
    if the reference stands or returns."""
    displacement = steps.sum(axis=0)
    distance, length = float(np.linalg.norm(displacement)), float(np.linalg.norm(steps, axis=-1).sum())
    if distance <= max(_STANDING, _STRAIGHT * length):
        return None
    return float(went @ displacement / distance)


def _paces(trajectory: Trajectory, duration: float) -> Array:
    """How much faster than at its own speed the reference of each rollout went on, (S,)."""
    went = trajectory.phases[:, -1] - trajectory.phases[:, 0]
    paces: Array = went * duration * CONTROL_RATE / (trajectory.phases.shape[1] - 1)
    return paces


def _path(path: Array, reference: Array, pace: float) -> dict[str, float | None]:
    gap = np.linalg.norm(path - reference, axis=-1)
    steps = np.diff(reference, axis=0)
    distance = float(np.linalg.norm(reference[-1] - reference[0]))
    length = float(np.linalg.norm(steps, axis=-1).sum())
    advance = advance_along(path[-1] - path[0], steps)
    return {
        "path_error_m": float(gap[-1]),
        "path_rms_m": float(np.sqrt(np.mean(gap**2))),
        "advance_m": advance,
        "reference_advance_m": distance,
        "reference_path_m": length,
        "speed_ratio": None if advance is None else pace * advance / distance,
    }


def torque(trajectory: Trajectory) -> dict[str, Any]:
    """Largest torques about one axis in all rollouts, falls included: of the joint nearest to its limit, and
    of each joint.

    The motors limit each of a joint's three axes, so `peak` (N·m) is the largest component and not the length
    of the torque vector, which may be up to √3 times as long. limit: of each axis, N·m; share: of the limit;
    1 means that the motor was saturated about an axis.
    """
    peaks = trajectory.torques.max(axis=(0, 1))  # (14,)
    joints = {
        body.node: {
            "peak": float(peak),
            "limit": body.torque_limit,
            "share": float(peak / body.torque_limit),
        }
        for body, peak in zip(BODIES[1:], peaks, strict=True)
    }
    highest = max(joints, key=lambda name: joints[name]["share"])
    return {"joint": highest, **joints[highest], "joints": joints}


def rewards(trajectory: Trajectory, config: RewardConfig) -> dict[str, Any]:
    """The reward: `terms`, mean of each from phase 0; `share`: spread over the start phases of the mean
    reward over all frames, as a share of the largest possible; `scales` and `weights` that it was computed
    with."""
    names = [str(name) for name in trajectory.reward_names]
    totals = trajectory.rewards.sum(axis=-1).mean(axis=-1) / sum(config.weights.values())
    return {
        "terms": dict(zip(names, trajectory.rewards[0].mean(axis=0).tolist(), strict=True)),
        "share": spread(totals),
        "scales": {name: config.scales[name] for name in config.weights},
        "weights": dict(config.weights),
    }


def _against_capture(
    trajectory: Trajectory, motion: Motion, capture: Capture | None, frames: int
) -> tuple[dict[str, Any] | None, dict[str, Any] | None]:
    if capture is None:
        return None, None
    rollouts = [
        Rollout(
            phases=trajectory.phases[k, :frames],
            angles=joint_angles(trajectory.rotations[k, :frames]),
            fallen_at=int(trajectory.fallen_at[k]),
            cyclic=motion.cyclic,
        )
        for k in range(len(trajectory.start_phases))
    ]
    used = capture.of_used()
    truth = truth_fits(used, motion, rollouts[0])

    def fits(part: Capture, against: Mapping[str, Array]) -> dict[str, Any]:
        each = [capture_fits(part, rollout, against=against) for rollout in rollouts]
        return {**over_phases(each), "frames": len(part.phase)}

    return (
        {
            **fits(used, used.raw),
            "all_frames": fits(capture, capture.raw),
            "adjusted": fits(used, used.adjusted),
        },
        None
        if truth is None
        else {
            source: {joint: of[joint].as_dict() for joint in SCORED_JOINTS} for source, of in truth.items()
        },
    )


def compose(
    trajectory: Trajectory,
    no_policy: Trajectory,
    motion: Motion,
    *,
    capture: Capture | None,
    reward: RewardConfig,
    policy: Mapping[str, Any],
    gait: Mapping[str, Any] | None = None,
    provenance: Mapping[str, Any],
) -> dict[str, Any]:
    """Content of scores.json: rounded JSON values, None for unknown or undefined numbers.

    no_policy: rollouts of the same task with the reference's PD targets alone; reward: of the trajectories;
    policy, gait: content of policy.json and gait.json.
    """
    # A non-cyclic motion (a kick, a jump) is scored as a whole, a gait over the paper's 500 frames.
    frames = FIT_FRAMES if motion.cyclic else trajectory.root.shape[1]
    fit_capture, truth = _against_capture(trajectory, motion, capture, frames)
    scores = {
        "schema": SCORES_SCHEMA,
        "survival": survival(trajectory),
        "fit": fit(trajectory, frames),
        "fit_capture": fit_capture,
        "no_policy": {
            "survival": survival(no_policy),
            "fit": fit(no_policy, frames),
            "tracking": tracking(no_policy),
            "root": root_path(no_policy, motion.duration),
        },
        "truth": truth,
        "tracking": tracking(trajectory),
        "root": root_path(trajectory, motion.duration),
        "torque": torque(trajectory),
        "reward": rewards(trajectory, reward),
        "train": {"seconds": policy.get("seconds"), **training_summary(policy)},
        "motion": _motion(motion, gait or {}),
        "capture": {
            "simulated": motion.simulated,
            "adjustments": None if capture is None else adjustments(capture, gait or {}),
        },
        "provenance": provenance,
    }
    values: dict[str, Any] = _json_values(scores)
    return values


def _motion(motion: Motion, gait: Mapping[str, Any]) -> dict[str, Any]:
    """What was imitated. kind: of gait.json, or of a loop's own gait; findings, refused: of the gate."""
    kind = gait.get("kind")
    if kind is None and motion.cyclic:
        kind = "run" if reference(motion).gait.running else "walk"
    return {
        "kind": kind or "motion",
        "cyclic": motion.cyclic,
        "findings": [finding["message"] for finding in gait.get("gate", ())],
        "refused": any(finding.get("severity") == "refuse" for finding in gait.get("gate", ())),
    }


def _json_values(value: Any) -> Any:
    """JSON values: rounded numbers, None for non-finite ones."""
    if isinstance(value, Mapping):
        return {str(key): _json_values(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_json_values(item) for item in value]
    if isinstance(value, float):
        return round(value, _DECIMALS) if np.isfinite(value) else None
    return value
