"""scores.json: metrics of the rollouts, under stable keys.

The main values (`survival.frames`, `fit.knee`, `fit.hip`, `root`) come from the rollout from phase 0.
Rollouts continue after a fall: the reference moves on, and all frames count. On the ground, the joints can
follow their targets easily, so every fit also has `r2_upright`, which gives no credit after a fall; without a
fall it equals `r2`. `fit.phases` and `survival.phases` cover the other start phases; `torque` is the maximum
over all.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kinemimic.evaluate.scoring.capture_fit import Capture, Rollout, capture_fits, truth_fits
from kinemimic.pipeline.gait.curve_metrics import MEASURES, SCORED_JOINTS, JointFit, joint_fits
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.retarget.humanoid.body import BODIES
from kinemimic.retarget.humanoid.motion import Motion, joint_angles
from kinemimic.train.rollout.trajectory import Trajectory

SCORES_SCHEMA = 1
FIT_FRAMES = 500  # as in the paper
_DECIMALS = 6
_STANDING = 0.1  # m: below this advance the reference stands, and there is no speed to compare with


def survival(trajectory: Trajectory) -> dict[str, int]:
    """Frames before the first fall from phase 0, and the number of start phases without a fall."""
    frames = trajectory.root.shape[1]
    return {
        "frames": int(min(trajectory.fallen_at[0], frames)),
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


def fit(trajectory: Trajectory, frames: int) -> dict[str, Any]:
    """Fit from phase 0 by joint and side, and its spread over all start phases."""
    rollouts = [rollout_fits(trajectory, k, frames) for k in range(len(trajectory.start_phases))]
    spread: dict[str, dict[str, dict[str, float]]] = {}
    for joint in SCORED_JOINTS:
        spread[joint] = {}
        for measure in MEASURES:
            values = [getattr(fits[joint].both, measure) for fits in rollouts]
            spread[joint][measure] = {
                "min": float(np.min(values)),
                "median": float(np.median(values)),
                "max": float(np.max(values)),
            }
    return {
        **{joint: rollouts[0][joint].as_dict() for joint in SCORED_JOINTS},
        "frames": min(frames, trajectory.root.shape[1]),
        "phases": spread,
    }


def root_path(trajectory: Trajectory) -> dict[str, float | None]:
    """The horizontal path from phase 0.

    path_error_m: final distance between humanoid and reference; path_rms_m: its root mean square over time;
    advance_m, reference_advance_m: displacement along the line from the reference's start to its end;
    speed_ratio: their quotient, None if the reference stands.
    """
    path, reference = trajectory.root[0, :, :2], trajectory.reference_root[0, :, :2]
    gap = np.linalg.norm(path - reference, axis=-1)
    way = reference[-1] - reference[0]
    distance = float(np.linalg.norm(way))
    moves = distance > _STANDING
    advance = float((path[-1] - path[0]) @ way / distance) if moves else None
    return {
        "path_error_m": float(gap[-1]),
        "path_rms_m": float(np.sqrt(np.mean(gap**2))),
        "advance_m": advance,
        "reference_advance_m": distance,
        "speed_ratio": None if advance is None else advance / distance,
    }


def torque(trajectory: Trajectory) -> dict[str, Any]:
    """Largest torques of all rollouts, falls included: `peak` over all joints in N·m, and of each joint.

    share: of the joint's limit; 1 means that the motor was saturated.
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
    highest = max(joints, key=lambda name: joints[name]["peak"])
    return {"peak": joints[highest]["peak"], "joint": highest, "joints": joints}


def rewards(trajectory: Trajectory) -> dict[str, float]:
    """Mean of each reward term over the frames from phase 0."""
    return {
        str(name): float(value)
        for name, value in zip(trajectory.reward_names, trajectory.rewards[0].mean(axis=0), strict=True)
    }


def _against_capture(
    trajectory: Trajectory, motion: Motion, capture: Capture | None, frames: int
) -> tuple[dict[str, Any] | None, dict[str, Any] | None]:
    if capture is None:
        return None, None
    rollout = Rollout(
        phases=trajectory.phases[0, :frames],
        angles=joint_angles(trajectory.rotations[0, :frames]),
        fallen_at=int(trajectory.fallen_at[0]),
        cyclic=motion.cyclic,
    )
    fits = capture_fits(capture, rollout)
    truth = truth_fits(capture, motion, rollout)
    return (
        {joint: fits[joint].as_dict() for joint in SCORED_JOINTS},
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
    policy: Mapping[str, Any],
    provenance: Mapping[str, Any],
) -> dict[str, Any]:
    """Content of scores.json: rounded JSON values, None for unknown or undefined numbers.

    no_policy: rollouts with the reference's PD targets alone; policy: content of policy.json.
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
            "root": root_path(no_policy),
        },
        "truth": truth,
        "root": root_path(trajectory),
        "torque": torque(trajectory),
        "reward": rewards(trajectory),
        "train": {key: policy.get(key) for key in ("samples", "seconds", "preset", "seed")},
        "capture": {"simulated": motion.simulated},
        "provenance": provenance,
    }
    values: dict[str, Any] = _json_values(scores)
    return values


def _json_values(value: Any) -> Any:
    """JSON values: rounded numbers, None for non-finite ones."""
    if isinstance(value, Mapping):
        return {str(key): _json_values(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_json_values(item) for item in value]
    if isinstance(value, float):
        return round(value, _DECIMALS) if np.isfinite(value) else None
    return value
