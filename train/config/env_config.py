"""Settings of the task: its reward, domain randomization, and when an episode ends."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from kinemimic.pipeline.files.validation.records import RecordError
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.train.scenario.scenario import Scenario

# Weights of the joints in the pose error, by the body that the joint moves; they sum to one.
POSE_WEIGHTS: dict[str, float] = {
    "pelvis": 0.20,
    "torso": 0.08,
    "head": 0.02,
    **{f"{limb}_{side}": weight
       for side in SIDES
       for limb, weight in (("upper_arm", 0.03), ("forearm", 0.02), ("hand", 0.01),
                            ("thigh", 0.13), ("shin", 0.11), ("foot", 0.05))},
}  # fmt: skip


@dataclass(frozen=True)
class RewardConfig:
    """R = Σ wᵢ exp(-kᵢ eᵢ), Eq. 1-5.

    form: "squares" takes eᵢ as a weighted mean of squares; "norm" as the norm of the difference, as
    published, with kᵢ = 1/ωᵢ and θ = 1 (its factor is part of the weight). Terms (`reward.py`): pose (rad),
    linear (m/s), angular (rad/s), height (m) and path, the horizontal distance of the root from its reference
    (m), without which a humanoid walks well but too slowly. RecordError for a weight without a scale.
    """

    form: Literal["squares", "norm"] = "squares"
    weights: dict[str, float] = field(
        default_factory=lambda: {"pose": 0.45, "linear": 0.18, "angular": 0.12, "height": 0.10, "path": 0.15}
    )
    scales: dict[str, float] = field(
        default_factory=lambda: {"pose": 8.0, "linear": 2.0, "angular": 0.05, "height": 40.0, "path": 8.0}
    )

    def __post_init__(self) -> None:
        if missing := self.weights.keys() - self.scales.keys():
            found = f"none for {', '.join(sorted(missing))}"
            raise RecordError("scales", expected="one for each weight", found=found)


@dataclass(frozen=True)
class DomainRandomization:
    """Ranges (low, high) from which an episode draws at full strength; the defaults change nothing.

    push: N, horizontal in any direction on the pelvis for 0.2 s; adaptive_push: in training, its upper end
    stands for a level that adapts to what the policy survives (`sampling/push_levels.py`); rest: s between
    pushes; friction: of the feet on the ground; mass: factor for every body; delay: s until an action takes
    effect, at most one control step; tilt, spin: standard deviations of the initial state from the reference,
    rad and rad/s, at the root and every joint; displacement: largest horizontal distance of the initial state
    from the reference, m; pace: factor on the speed of a tracker's references, whose steps stay the same;
    obstacles: share of the episodes with obstacles in the way (`scenario/clutter.py`), in place of pushes.
    RecordError for adaptive pushes of 0 N, and for a share above 1 or below 0.
    """

    push: tuple[float, float] = (0.0, 0.0)
    adaptive_push: bool = False
    rest: tuple[float, float] = (1.0, 3.0)
    friction: tuple[float, float] = (0.9, 0.9)
    mass: tuple[float, float] = (1.0, 1.0)
    delay: tuple[float, float] = (0.0, 0.0)
    tilt: float = 0.0
    spin: float = 0.0
    displacement: float = 0.0
    pace: tuple[float, float] = (1.0, 1.0)
    obstacles: float = 0.0

    def __post_init__(self) -> None:
        if self.adaptive_push and not self.push[1] > 0.0:
            raise RecordError("push", expected="an upper end above 0 N", found=f"{self.push[1]:g}")
        if not 0.0 <= self.obstacles <= 1.0:
            raise RecordError("obstacles", expected="a share from 0 to 1", found=f"{self.obstacles:g}")


# Ranges that policies of earlier versions do not state, in JSON.
LATER_RANGES = {"displacement": 0.0, "pace": [1.0, 1.0], "adaptive_push": False, "obstacles": 0.0}


# Limits that trackers of earlier versions do not state. Every other policy clips its normalised observations
# at OBSERVATION_CLIP.
OBSERVATION_CLIP = 8.0
LATER_LIMITS = {"limit": OBSERVATION_CLIP, "arm_limit": OBSERVATION_CLIP}


@dataclass(frozen=True)
class Tracking:
    """The task of a tracker, a policy for any motion. It observes no phase; beside the preview, it observes
    the difference to the reference now, in rotations, positions and velocities.

    max_body_error: mean distance of the bodies from their references at which an episode ends, m; in
    training, `TrainConfig.body_error` may change it. leash: the policy observes a reference that is farther
    away on the ground as if it were this far, m. limit, arm_limit: at which its normalised observations are
    clipped, in standard deviations; arm_limit for those of the arms.
    """

    max_body_error: float = 0.5
    leash: float = 0.3
    limit: float = OBSERVATION_CLIP
    arm_limit: float = OBSERVATION_CLIP

    def __post_init__(self) -> None:
        for name in LATER_LIMITS:
            value = getattr(self, name)
            if not value > 0.0:
                raise RecordError(name, expected="a number above 0", found=f"{value}")


@dataclass(frozen=True)
class EnvConfig:
    """The task; durations in control steps of 1/30 s, lengths in metres, angles in radians.

    episode: length of an episode. max_height_error, max_rotation_error, max_drift: errors of the pelvis's
    height and rotation and of the path at which an episode ends.
    residual: actions correct the reference's joints; without it, they are the joint targets.
    velocity_feedforward, torque_feedforward: whether the stable PD also gets the reference's velocities and
    the torques of its inverse dynamics (`dynamics.py`). start_anywhere: episodes start at a random phase, not
    at phase 0. mirror: the policy learns half a gait cycle and performs the other half mirrored; no
    effect on non-cyclic or too asymmetric motions (`mirror.py`). preview: how many control steps ahead the
    policy observes its reference; RecordError if empty. scenario: applied in every training episode; it sets
    the episode's length and start phase. tracking: makes the policy a tracker; it mirrors whatever the motion
    (`mirror.py`). balance: ankles and hips keep the humanoid over its standing feet, and actions correct that
    too (`task/balance.py`). hurry: the reference runs faster while the humanoid is pushed ahead or aside
    (`task/hurry.py`). observed_obstacles: how many of the nearest obstacles the policy observes
    (`task/obstacle_observation.py`), none by default.
    """

    reward: RewardConfig = field(default_factory=RewardConfig)
    episode: int = 300
    max_height_error: float = 0.25
    max_rotation_error: float = 1.0
    max_drift: float = 0.6
    residual: bool = True
    velocity_feedforward: bool = True
    torque_feedforward: bool = True
    start_anywhere: bool = True
    mirror: bool = True
    preview: tuple[int, ...] = (1,)
    domain_randomization: DomainRandomization = field(default_factory=DomainRandomization)
    scenario: Scenario | None = None
    tracking: Tracking | None = None
    balance: bool = False
    hurry: bool = False
    observed_obstacles: int = 0

    def __post_init__(self) -> None:
        if not self.preview:
            raise RecordError("preview", expected="at least one number of control steps", found="none")
        if self.observed_obstacles < 0:
            raise RecordError("observed_obstacles", expected="at least 0", found=f"{self.observed_obstacles}")

    @property
    def steps(self) -> int:
        """Control steps of an episode: its scenario's, if it has one."""
        return self.episode if self.scenario is None else self.scenario.steps
