"""Settings of a training, and the presets.

`default` is what follows its reference best, `robust` what is hard to fell, `paper` what is printed; `ddpg`,
`a2c` and `sb3-ppo` do `default`'s task with stable-baselines3's algorithms (`rival_config.py`).
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
    StablePpo,
)
from kinemimic.train.scenario.scenario import Scenario

# Weights of the joints in the pose error, by the body that the joint carries; they sum to one.
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

    form: "squares" takes eᵢ as a weighted mean of squares; "norm" the plain norm of the difference, as
    printed, with kᵢ = 1/ωᵢ and θ = 1 (its own factor is in the weight).
    Terms: pose (rad), linear (m/s), angular (rad/s), height (m) and, in the default preset only, path: the
    horizontal distance of the root from its reference (m), without which a figure walks well but too slowly.
    ValueError for another form, and for a weight without a scale; what terms there are, `reward.py` says.
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
    """Ranges (lowest, highest) of what an episode draws at full strength; with none of it, all are calm.

    push: N, horizontal in any direction on the pelvis for 0.2 s; rest: s between pushes; friction: of the
    feet on the ground; mass: factor of every body; delay: s until a correction takes effect, one control
    step at most; tilt, spin: standard deviations of what the start is off its reference, rad and rad/s at the
    root and at every joint.
    """

    push: tuple[float, float] = (0.0, 0.0)
    rest: tuple[float, float] = (1.0, 3.0)
    friction: tuple[float, float] = (0.9, 0.9)
    mass: tuple[float, float] = (1.0, 1.0)
    delay: tuple[float, float] = (0.0, 0.0)
    tilt: float = 0.0
    spin: float = 0.0


@dataclass(frozen=True)
class EnvConfig:
    """The task: lengths in control steps of 1/30 s, metres, radians.

    residual: the policy corrects the reference's joints; without it, it gives the joints themselves.
    velocity_feedforward, torque_feedforward: what of the reference goes to the stable PD beside its angles:
    its speeds, and the torques of its inverse dynamics (`dynamics.py`).
    start_anywhere: episodes begin at any phase, not at the first.
    mirror: the policy learns the first half of a gait's cycle, and does the second as in a mirror; without
    effect on what is performed once or is too unlike its mirror image (`mirror.py`).
    preview: how many control steps ahead the policy sees its reference; ValueError if nowhere.
    scenario: what befalls every figure that trains; it says how long an episode lasts and where it begins.
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

    def __post_init__(self) -> None:
        if not self.preview:
            raise RecordError("preview", expected="at least one number of control steps", found="none")

    @property
    def steps(self) -> int:
        """Control steps of an episode: those of its scenario, where there is one."""
        return self.episode if self.scenario is None else self.scenario.steps


# A number that changes with the samples: (samples, value) points, linear between them, constant beyond.
Schedule = tuple[tuple[int, float], ...]


def scheduled_at(schedule: Schedule, samples: int) -> float:
    """The value after so many samples."""
    at, values = zip(*schedule, strict=True)
    return float(np.interp(samples, at, values))


@dataclass(frozen=True)
class TrainConfig:
    """PPO: see `ppo.py` for what each number does; with a `rival`, what `rival_config.py` says of it.

    ValueError if the rival does not train a whole number of times in a round, or a schedule has no point.
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
    # Reward scales that change: a gentle pose term learns to walk sooner, a tight one then fits the joints,
    # which a walk that cannot fall any more can afford.
    scales: dict[str, Schedule] = field(
        default_factory=lambda: {"pose": ((300_000, 8.0), (500_000, 32.0), (1_100_000, 64.0))}
    )
    # Of the hardships, 0 to 1: who cannot walk yet learns nothing from being pushed.
    strength: Schedule = ((0, 0.0),)
    entropy: float = 0.0
    entropy_decay: float = 1.0
    budget: int = 1_000_000
    seed: int = 0
    baseline: Baseline | None = None

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
        """Of the policy's hidden units."""
        return self.baseline.activation if self.baseline else "tanh"

    @property
    def bound(self) -> float | None:
        """Of the policy's actions, by a tanh; None where they have none."""
        return self.baseline.bound if self.baseline else None

    @property
    def batch(self) -> int:
        """Samples of a round."""
        return self.num_envs * self.horizon

    def reward(self, samples: int) -> RewardConfig:
        """The reward in force after so many samples."""
        scheduled = {name: scheduled_at(schedule, samples) for name, schedule in self.scales.items()}
        return replace(self.env.reward, scales={**self.env.reward.scales, **scheduled})

    @property
    def final_reward(self) -> RewardConfig:
        """The reward that the schedules end with."""
        return self.reward(max((schedule[-1][0] for schedule in self.scales.values()), default=0))

    def to_json(self) -> dict[str, Any]:
        """JSON values that `from_json` reads back."""
        value: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(self))
        # Without a baseline or a scenario, the JSON stays as it was before they were introduced.
        if self.baseline is None:
            del value["baseline"]
        if self.env.scenario is None:
            del value["env"]["scenario"]
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
            value = {"baseline": None, **value}
            value["env"] = {"scenario": None, **env} if isinstance(env, dict) else env
        return convert(value, cls, path, complete=True, within=within)


PRESETS: dict[str, TrainConfig] = {
    "default": TrainConfig(),
    # For whoever is pushed, slips, weighs more or reacts late. An episode bears more before it ends; what it
    # is trained for costs fit. A push leaves the figure half a metre off its path, where the path term of
    # `default` is all but zero and nothing calls it back: it would walk on too slowly. So the term reaches
    # further, and weighs more, since the same distance then changes it less.
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
    # Nets, rates, discount, batch, passes, clip and entropy as printed; one batch a pass; KL target η and the
    # constants θ, ω, wᵢ are not given in the paper; of leading torques and of mirrors it knows nothing.
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
    # The rivals, on `default`'s task with its nets, figures, discount and schedules of noise and reward, but
    # where a search (`evaluate/variants.py`) found something better.
    "ddpg": TrainConfig(
        preset="ddpg", action_std=((0, 0.2), (400_000, 0.1), (1_000_000, 0.05)), baseline=Ddpg()
    ),
    # A quarter of the figures, each four times as long between rounds: gradient steps on 64 new samples are
    # four times as many as on 256, and there is but one for each.
    "a2c": TrainConfig(preset="a2c", num_envs=16, horizon=256, baseline=A2c()),
    "sb3-ppo": TrainConfig(preset="sb3-ppo", baseline=StablePpo()),
}


def preset(name: str, **changes: Any) -> TrainConfig:
    """A preset by name, with changes."""
    if name not in PRESETS:
        raise KinemimicError(f"expected a preset among {', '.join(PRESETS)}, found {name!r}")
    return replace(PRESETS[name], **changes)
