"""How closely all bodies follow the reference, by the measures that papers on motion tracking report.

Success rate, MPJPE, E_vel and E_acc as in the evaluation of PHC (Luo et al., "Perpetual Humanoid Control for
Real-time Simulated Avatars", ICCV 2023), on the 15 joints at which the rigid bodies are attached.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.retarget.humanoid.body import BODY_NODES, node_offsets
from kinemimic.retarget.humanoid.motion import node_kinematics
from kinemimic.train.rollout.trajectory import Trajectory

FAILURE_DISTANCE = 0.5  # m, of the mean over the joints
TRACKING_MEASURES = ("mpjpe_g_mm", "mpjpe_l_mm", "vel_mm", "acc_mm")


def body_positions(root: Array, rotations: Array) -> Array:
    """World positions (T, 15, 3) of the joints at which the humanoid's bodies are attached, metres.

    root: (T, 3) hip centre; rotations: (T, 20, 4) local, of the nodes.
    """
    positions, _ = node_kinematics(root, rotations, node_offsets())
    return positions[:, BODY_NODES]


def tracking_errors(simulated: Array, reference: Array) -> dict[str, float | bool | None]:
    """Errors of one rollout, from positions (T, 15, 3) at one frame rate, the root first.

    succeeded: whether the mean distance of the joints from the reference never exceeds FAILURE_DISTANCE. The
    errors are means over the frames up to a failure, without the frame of the failure; None if that leaves
    too few. mpjpe_g_mm: distance of the joints; mpjpe_l_mm: the same relative to the root, without turning
    it; vel_mm, acc_mm: distance of the joints' first and second differences, mm per frame and frame².
    """
    distance = np.linalg.norm(simulated - reference, axis=-1).mean(axis=-1)
    failures = np.flatnonzero(distance > FAILURE_DISTANCE)
    end = int(failures[0]) if len(failures) else len(distance)
    simulated, reference = simulated[:end], reference[:end]
    differences = (
        simulated - reference,
        (simulated - simulated[:, :1]) - (reference - reference[:, :1]),
        np.diff(simulated - reference, axis=0),
        np.diff(simulated - reference, n=2, axis=0),
    )
    errors: dict[str, float | bool | None] = {"succeeded": not len(failures)}
    for name, difference in zip(TRACKING_MEASURES, differences, strict=True):
        found = np.linalg.norm(difference, axis=-1)
        errors[name] = 1000.0 * float(found.mean()) if found.size else None
    return errors


def tracking(trajectory: Trajectory) -> dict[str, Any]:
    """`tracking_errors` from phase 0; `phases`: over all start phases, the number that `succeeded`, `of` how
    many, and the spread of each error over `all` and over the `successful`, None without any."""
    rollouts = [
        tracking_errors(body_positions(*simulated), body_positions(*reference))
        for simulated, reference in zip(
            zip(trajectory.root, trajectory.rotations, strict=True),
            zip(trajectory.reference_root, trajectory.reference_rotations, strict=True),
            strict=True,
        )
    ]
    successful = [errors for errors in rollouts if errors["succeeded"]]
    return {
        **rollouts[0],
        "phases": {
            "succeeded": len(successful),
            "of": len(rollouts),
            "all": _spreads(rollouts),
            "successful": _spreads(successful),
        },
    }


def _spreads(rollouts: Sequence[dict[str, float | bool | None]]) -> dict[str, Any] | None:
    if not rollouts:
        return None
    spreads: dict[str, Any] = {}
    for name in TRACKING_MEASURES:
        values = [value for errors in rollouts if (value := errors[name]) is not None]
        spreads[name] = (
            {"min": min(values), "median": float(np.median(values)), "max": max(values)} if values else None
        )
    return spreads
