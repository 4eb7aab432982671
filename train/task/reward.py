"""Terms of the imitation reward (the paper's Eq. 1-5): pure functions of simulated and reference bodies.

`pose_turns` gives the rotation between the poses, `errors` each term's error (E,), and `rewards` the terms of
Σ w exp(-k e). A new term goes into `errors`; its weight and scale into `RewardConfig`.
"""

from __future__ import annotations

import numpy as np

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.rotations import conjugate, multiply, to_rotvec
from kinemimic.retarget.humanoid.body import BODY_NAMES
from kinemimic.train.config.env_config import POSE_WEIGHTS, RewardConfig
from kinemimic.train.sim.world import JOINT_PARENTS, BodyStates

_WEIGHTS: Array = np.array([POSE_WEIGHTS[name] for name in BODY_NAMES])
_ROOT_WEIGHTS: Array = np.sqrt(_WEIGHTS)[:, None]
_PARENTS = np.array([0, *JOINT_PARENTS])


def pose(rotations: Array) -> Array:
    """Pose (..., 15, 4) of bodies' rotations in the world: the pelvis in the world, joints local."""
    found = multiply(conjugate(rotations.take(_PARENTS, axis=-2)), rotations)
    found[..., 0, :] = rotations[..., 0, :]
    return found


def pose_turns(sim: BodyStates, *refs: BodyStates) -> Array:
    """Rotation vectors (R, E, 15, 3) from the simulated pose to each reference's, in the pose's own frames,
    rad."""
    poses = pose(np.stack([sim.rotations, *(ref.rotations for ref in refs)]))
    return to_rotvec(multiply(conjugate(poses[0]), poses[1:]))


def errors(sim: BodyStates, ref: BodyStates, turns: Array, config: RewardConfig) -> dict[str, Array]:
    """Errors eᵢ (E,) of the terms with a weight, in the configuration's form.

    turns: (E, 15, 3) of `pose_turns`. KinemimicError for a weight of an unknown term.
    """
    differences = {
        "pose": turns,
        "linear": sim.linear - ref.linear,
        "angular": sim.angular - ref.angular,
        "height": sim.positions[:, :1, 2:] - ref.positions[:, :1, 2:],
        "path": sim.positions[:, :1, :2] - ref.positions[:, :1, :2],
    }
    if strange := config.weights.keys() - differences.keys():
        raise KinemimicError(f"reward: expected {', '.join(differences)}, found {', '.join(sorted(strange))}")
    if config.form == "norm":
        return {name: np.sqrt(_total(differences[name])) for name in config.weights}
    differences["pose"] = turns * _ROOT_WEIGHTS
    # The weights of the pose sum to one; velocities are averaged over the bodies.
    bodies = {"linear": len(_WEIGHTS), "angular": len(_WEIGHTS)}
    return {name: _total(differences[name]) / bodies.get(name, 1) for name in config.weights}


def _total(differences: Array) -> Array:
    """Sum of squares (E,) over bodies and axes of (E, bodies, axes)."""
    total: Array = np.einsum("ebi,ebi->e", differences, differences)
    return total


def rewards(sim: BodyStates, ref: BodyStates, turns: Array, config: RewardConfig) -> Array:
    """Weighted terms (E, K) in the order of the configuration's weights; their sum is the reward."""
    found = errors(sim, ref, turns, config)
    scales = np.array([config.scales[name] for name in found])
    weights = np.array([config.weights[name] for name in found])
    terms: Array = weights * np.exp(-scales * np.stack([*found.values()], axis=-1))
    return terms
