"""Settings of a training, and the presets.

`default` follows its reference most closely, `robust` resists disturbances, `paper` has the published values.
The others train `default`'s task with an algorithm of stable-baselines3 (`baseline_config.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.records import RecordError, Steps, convert
from kinemimic.train.config.baseline_config import (
    A2c,
    Activation,
    Baseline,
    Ddpg,
    Sac,
    StablePpo,
    Td3,
)
from kinemimic.train.scenario.scenario import Scenario

# Weights of the joints in the pose error, by the body that the joint moves; they sum to one.
POSE_WEIGHTS: dict[str, float] = {
    "pelvis": 0.20,
    "torso": 0.08,
    "head": 0.02,
    **{f"{limb}_{side}": weight
       for side in ("left", "right")
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

    push: N, horizontal in any direction on the pelvis for 0.2 s; rest: s between pushes; friction: of the
    feet on the ground; mass: factor for every body; delay: s until an action takes effect, at most one
    control step; tilt, spin: standard deviations of the initial state from the reference, rad and rad/s, at
    the root and every joint; displacement: largest horizontal distance of the initial state from the
    reference, m; pace: factor on the speed of a tracker's references, whose steps stay the same.
    """

    push: tuple[float, float] = (0.0, 0.0)
    rest: tuple[float, float] = (1.0, 3.0)
    friction: tuple[float, float] = (0.9, 0.9)
    mass: tuple[float, float] = (1.0, 1.0)
    delay: tuple[float, float] = (0.0, 0.0)
    tilt: float = 0.0
    spin: float = 0.0
    displacement: float = 0.0
    pace: tuple[float, float] = (1.0, 1.0)


# Ranges that policies of earlier versions do not state, in JSON.
_LATER_RANGES = {"displacement": 0.0, "pace": [1.0, 1.0]}


@dataclass(frozen=True)
class Tracking:
    """The task of a tracker, a policy for any motion. It observes no phase; beside the preview, it observes
    the difference to the reference now, in rotations, positions and velocities.

    max_body_error: mean distance of the bodies from their references at which an episode ends, m; in a
    training, `TrainConfig.body_error` may change it. leash: the policy observes a reference that is farther
    away on the ground as if it were this far, m.
    """

    max_body_error: float = 0.5
    leash: float = 0.3


@dataclass(frozen=True)
class EnvConfig:
    """The task; durations in control steps of 1/30 s, lengths in metres, angles in radians.

    residual: actions correct the reference's joints; without it, they are the joint targets.
    velocity_feedforward, torque_feedforward: whether the stable PD also gets the reference's velocities and
    the torques of its inverse dynamics (`dynamics.py`). start_anywhere: episodes start at a random phase, not
    at phase 0. mirror: the policy learns the first half of a gait cycle and plays the second mirrored; no
    effect on non-cyclic or too asymmetric motions (`mirror.py`). preview: how many control steps ahead the
    policy observes its reference; RecordError if empty. scenario: applied in every training episode; it sets
    the episode's length and start phase. tracking: makes the policy a tracker; it mirrors whatever the motion
    (`mirror.py`).
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

    def __post_init__(self) -> None:
        if not self.preview:
            raise RecordError("preview", expected="at least one number of control steps", found="none")

    @property
    def steps(self) -> int:
        """Control steps of an episode: its scenario's, if it has one."""
        return self.episode if self.scenario is None else self.scenario.steps


# A value that depends on the samples so far: points (samples, value), linear between them, constant beyond.
Schedule = tuple[tuple[int, float], ...]


def scheduled_at(schedule: Schedule, samples: int) -> float:
    """The value after that many samples."""
    at, values = zip(*schedule, strict=True)
    return float(np.interp(samples, at, values))


@dataclass(frozen=True)
class TrainConfig:
    """Settings of PPO (see `ppo.py`), or of a baseline (see `baseline_config.py`).

    start: SHA-256 of the policy from which the training starts, "" for random weights.

    RecordError if a round is not a whole number of the baseline's updates, or a schedule has no points.
    """

    preset: str = "default"
    env: EnvConfig = field(default_factory=EnvConfig)
    hidden: tuple[int, ...] = (512, 256)
    num_envs: int = 64
    horizon: int = 64
    minibatch: int = 512
    epochs: int = 8
    clip: float | None = 0.2
    kl_penalty: bool = False
    penalty_rule: str = "running"
    penalty_initial: float = 1.0
    kl_target: float = 0.1
    adapt_rate: bool = True
    actor_rate: float = 3e-4
    critic_rate: float = 1e-3
    discount: float = 0.95
    gae_lambda: float = 0.95
    learn_action_std: bool = False
    action_std: Schedule = ((0, 0.08), (400_000, 0.04), (1_000_000, 0.02))
    # Scheduled reward scales: a loose pose term learns to walk sooner; a tight one then fits the joints, once
    # the walk is stable.
    scales: dict[str, Schedule] = field(
        default_factory=lambda: {"pose": ((300_000, 8.0), (500_000, 32.0), (1_100_000, 64.0))}
    )
    # Of domain randomization, 0 to 1: a policy that cannot walk yet learns nothing from pushes.
    strength: Schedule = ((0, 0.0),)
    # In place of a tracker's `max_body_error`, which may narrow as it falls less; empty: constant.
    body_error: Schedule = ()
    entropy: float = 0.0
    entropy_decay: float = 1.0
    budget: int = 1_000_000
    seed: int = 0
    baseline: Baseline | None = None
    start: str = ""

    def __post_init__(self) -> None:
        schedules = {"action_std": self.action_std, "strength": self.strength}
        schedules |= {f"scales.{name}": schedule for name, schedule in self.scales.items()}
        for name, schedule in schedules.items():
            if not schedule:
                raise RecordError(name, expected="points (samples, value) of a schedule", found="none")
        if self.baseline and self.horizon % self.baseline.steps:
            expected = f"a multiple of the baseline's {self.baseline.steps} steps"
            raise RecordError("horizon", expected=expected, found=f"{self.horizon}")

    @property
    def activation(self) -> Activation:
        """Activation of the policy's hidden units."""
        return self.baseline.activation if self.baseline else "tanh"

    @property
    def bound(self) -> float | None:
        """Largest action of the policy, by a tanh; None if unbounded."""
        return self.baseline.bound if self.baseline else None

    @property
    def batch(self) -> int:
        """Samples of a round."""
        return self.num_envs * self.horizon

    def reward(self, samples: int) -> RewardConfig:
        """The reward after that many samples."""
        scheduled = {name: scheduled_at(schedule, samples) for name, schedule in self.scales.items()}
        return replace(self.env.reward, scales={**self.env.reward.scales, **scheduled})

    @property
    def final_reward(self) -> RewardConfig:
        """The reward that the schedules end with."""
        return self.reward(max((schedule[-1][0] for schedule in self.scales.values()), default=0))

    @property
    def measured_env(self) -> EnvConfig:
        """The task of a trained policy, with the reward that the schedules end with, as scores state it."""
        return replace(self.env, reward=self.final_reward)

    def to_json(self) -> dict[str, Any]:
        """JSON values that `from_json` reads back."""
        value: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(self))
        # The JSON stays as before these were introduced where it does without them.
        if self.baseline is None:
            del value["baseline"]
        if not self.start:
            del value["start"]
        if not self.body_error:
            del value["body_error"]
        for name in ("scenario", "tracking"):
            if getattr(self.env, name) is None:
                del value["env"][name]
        drawn = value["env"]["domain_randomization"]
        for name, unused in _LATER_RANGES.items():
            if drawn[name] == unused:
                del drawn[name]
        return value

    @classmethod
    def from_json(
        cls, value: Any, path: Path | str = "a training configuration", within: Steps = ()
    ) -> TrainConfig:
        """The configuration of a stored policy; a KinemimicError names the first key that does not fit.

        path, within: the file and the configuration's key in it, for messages.
        """
        if isinstance(value, dict):
            env = value.get("env")
            value = {"baseline": None, "start": "", "body_error": [], **value}
            if isinstance(env, dict):
                value["env"] = env = {"scenario": None, "tracking": None, **env}
                drawn = env.get("domain_randomization")
                if isinstance(drawn, dict):
                    env["domain_randomization"] = {**_LATER_RANGES, **drawn}
        return convert(value, cls, path, complete=True, within=within)


PRESETS: dict[str, TrainConfig] = {
    "default": TrainConfig(),
    # For pushes, low friction, other masses and late actions. Episodes tolerate larger errors before they
    # end; robustness costs fit. A push moves the humanoid half a metre off its path, where the path term of
    # `default` is nearly zero and has no gradient: it would walk on too slowly. So the term has a longer
    # range, and a larger weight, since the same distance then changes it less.
    "robust": TrainConfig(
        preset="robust",
        env=EnvConfig(
            reward=RewardConfig(
                weights={"pose": 0.45, "linear": 0.18, "angular": 0.12, "height": 0.10, "path": 0.45}
            ),
            max_height_error=0.35,
            max_rotation_error=1.3,
            max_drift=1.5,
            domain_randomization=DomainRandomization(
                push=(0.0, 300.0),
                rest=(1.0, 3.0),
                friction=(0.5, 1.0),
                mass=(0.9, 1.1),
                delay=(0.0, 0.0125),
                tilt=0.05,
                spin=0.2,
            ),
        ),
        action_std=((0, 0.08), (400_000, 0.05), (1_600_000, 0.03)),
        strength=((400_000, 0.0), (1_400_000, 1.0)),
        scales={
            "pose": ((300_000, 8.0), (500_000, 32.0), (1_100_000, 64.0)),
            "path": ((400_000, 8.0), (1_400_000, 2.0)),
        },
        budget=3_000_000,
    ),
    # Networks, rates, discount, batch, epochs, clip and entropy as published; one batch per epoch. The paper
    # does not give the KL target η and the constants θ, ω, wᵢ; it has no torque feed-forward and no
    # mirroring.
    "paper": TrainConfig(
        preset="paper",
        env=EnvConfig(
            reward=RewardConfig(
                form="norm",
                weights={"pose": 0.5, "linear": 0.2, "angular": 0.15, "height": 0.15},
                scales={"pose": 1.0, "linear": 0.2, "angular": 0.05, "height": 10.0},
            ),
            max_drift=float("1e9"),
            torque_feedforward=False,
            mirror=False,
        ),
        hidden=(1024, 512),
        minibatch=4096,
        epochs=10,
        kl_penalty=True,
        kl_target=0.01,
        adapt_rate=False,
        discount=0.99,
        learn_action_std=True,
        action_std=((0, 0.15),),
        scales={},
        entropy=0.01,
        entropy_decay=0.95,
        budget=1_000_000,
    ),
    # The baselines, on `default`'s task with its networks, environments, discount and schedules of action_std
    # and reward, except where a search (`evaluate/compare/variants.py`) found better values.
    "ddpg": TrainConfig(
        preset="ddpg", action_std=((0, 0.2), (400_000, 0.1), (1_000_000, 0.05)), baseline=Ddpg()
    ),
    "td3": TrainConfig(
        preset="td3", action_std=((0, 0.2), (400_000, 0.1), (1_000_000, 0.05)), baseline=Td3()
    ),
    "sac": TrainConfig(preset="sac", baseline=Sac()),
    # A quarter of the environments with four times the horizon: gradient steps on 64 new samples are four
    # times as many as on 256, and A2C takes only one for each.
    "a2c": TrainConfig(preset="a2c", num_envs=16, horizon=256, baseline=A2c()),
    "sb3-ppo": TrainConfig(preset="sb3-ppo", baseline=StablePpo()),
}


def preset(name: str, **changes: Any) -> TrainConfig:
    """A preset by name, with changes."""
    if name not in PRESETS:
        raise KinemimicError(f"expected a preset among {', '.join(PRESETS)}, found {name!r}")
    return replace(PRESETS[name], **changes)
