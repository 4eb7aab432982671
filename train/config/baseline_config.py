"""Settings of the baselines: stable-baselines3's algorithms instead of our PPO, everything else being equal.

The rest of `TrainConfig` is shared: task, rewards and their schedule, hidden layers, discount, samples per
round, budget; also exploration and the number of environments, unless a preset changes them (`presets.py`).
Baselines ignore the settings of our PPO (`minibatch` to `critic_rate`, `gae_lambda`, the entropy weight).
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import ClassVar, Literal

from msgspec import Struct

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.validation.records import RecordError

Activation = Literal["tanh", "relu"]


def require_counts(settings: object, *names: str) -> None:
    """RecordError if one of these settings is less than 1."""
    for name in names:
        if (found := getattr(settings, name)) < 1:
            raise RecordError(name, expected="a whole number from 1", found=f"{found}")


class OffPolicy(Struct, frozen=True, forbid_unknown_fields=True, tag_field="algorithm"):
    """What DDPG, TD3 and SAC have in common: an actor of bounded actions, and a replay buffer.

    actor_rate, critic_rate: of Adam; batch: samples of a gradient step; train_every: control steps of all
    environments between two updates; updates_per_sample: gradient steps per sample; tau: Polyak coefficient
    of the target networks; buffer: samples in the replay buffer; warm_up: samples before the first gradient
    step, in whole rounds; bound: largest action, the factor of the actor's tanh.
    """

    # As published for DDPG: the critic learns ten times as fast as the actor.
    actor_rate: float = 1e-4
    critic_rate: float = 1e-3
    batch: int = 256
    train_every: int = 1
    # PPO uses each sample eight times, this thirty-two times.
    updates_per_sample: float = 0.125
    tau: float = 0.005
    # 0.7 GB. Rewards are recomputed under the current schedule (`replay_memory.py`), so old samples stay
    # valid.
    buffer: int = 300_000
    # With the actor's own small actions and noise: the usual uniform actions make the humanoid fall
    # at once.
    warm_up: int = 8192
    # Half a radian in the legs: the shipped walks and run need 0.46 at most. With twice that, the actor
    # explores states that its critic has never seen, and falls sooner.
    bound: float = 0.5
    activation: Activation = "relu"

    def __post_init__(self) -> None:
        require_counts(self, "batch", "train_every", "buffer")

    @property
    def steps(self) -> int:
        """Control steps of all environments between two updates."""
        return self.train_every


class Ddpg(OffPolicy, frozen=True, tag="ddpg"):
    """Deep deterministic policy gradient (Lillicrap et al. 2016)."""


class Td3(OffPolicy, frozen=True, tag="td3"):
    """Twin delayed DDPG (Fujimoto et al. 2018): two critics, of which the lower counts.

    policy_delay: critic updates per actor update; target_noise, target_clip: standard deviation and largest
    size of the noise on the target's action, relative to the bound.
    """

    policy_delay: int = 2
    target_noise: float = 0.2
    target_clip: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        require_counts(self, "policy_delay")


class Sac(OffPolicy, frozen=True, tag="sac"):
    """Soft actor-critic (Haarnoja et al. 2018): two critics, and a stochastic actor whose entropy counts.

    Its actor's standard deviation starts at the scheduled `action_std`, and is learned. entropy_rate: of the
    entropy's weight; entropy: its initial weight; target: mean entropy of an action's 42 parts, relative to
    the bound, that the weight is learned for.
    """

    # Published with one rate for all networks.
    actor_rate: float = 3e-4
    critic_rate: float = 3e-4
    entropy_rate: float = 3e-4
    # Published with 1. A reward is at most 1 a step, and the entropy of 42 joints would outweigh it.
    entropy: float = 0.01
    target: float = -1.0


class A2c(Struct, frozen=True, forbid_unknown_fields=True, tag_field="algorithm", tag="a2c"):
    """Advantage actor-critic, synchronous (Mnih et al. 2016): one gradient step on what was just sampled.

    actor_rate, critic_rate: of the optimiser; n_steps: control steps of every environment per gradient step;
    gae_lambda: of the advantages; max_grad_norm: of both networks' gradient together; use_rms_prop: else
    Adam; normalize_advantage: to zero mean and unit variance in every gradient step.
    """

    # A tenth of our PPO's initial rate: nothing clips a step, and when action_std shrinks to a quarter the
    # same step changes the policy sixteen times as much (KL divergence).
    actor_rate: float = 3e-5
    critic_rate: float = 1e-3
    # Twice the gradient steps per sample: the search preferred it; three seeds show no difference.
    n_steps: int = 4
    gae_lambda: float = 0.95
    max_grad_norm: float = 0.5
    # RMSProp, as published, starts with steps ten times too long; Adam corrects the bias of its means.
    use_rms_prop: bool = False
    normalize_advantage: bool = True
    activation: Activation = "tanh"
    # The mean of a Gaussian is unbounded.
    bound: ClassVar[None] = None

    def __post_init__(self) -> None:
        require_counts(self, "n_steps")

    @property
    def steps(self) -> int:
        """Control steps of all environments between two updates."""
        return self.n_steps


class StablePpo(Struct, frozen=True, forbid_unknown_fields=True, tag_field="algorithm", tag="ppo"):
    """PPO (Schulman et al. 2017) of stable-baselines3, with the rounds of our PPO.

    actor_rate, critic_rate: of Adam; batch: samples of a gradient step; epochs: over a round; clip: of the
    ratio; gae_lambda: of the advantages; max_grad_norm: of both networks' gradient together.
    """

    # Constant, where ours adapts to a KL divergence of 0.1 per round: 1e-4 gives twice that with the initial
    # action_std, and the final one makes every step count sixteen times as much. Its own remedy, to stop a
    # round's epochs at a KL limit, stops the critic too, which then learns too little.
    actor_rate: float = 5e-5
    critic_rate: float = 1e-3
    batch: int = 512
    epochs: int = 8
    clip: float = 0.2
    gae_lambda: float = 0.95
    max_grad_norm: float = 1.0
    # The search preferred it to tanh and any other change; three seeds show no difference.
    activation: Activation = "relu"
    bound: ClassVar[None] = None

    def __post_init__(self) -> None:
        require_counts(self, "batch", "epochs")

    @property
    def steps(self) -> int:
        """1: any round length will do."""
        return 1


Baseline = Ddpg | Td3 | Sac | A2c | StablePpo


def require_package() -> None:
    """KinemimicError if stable-baselines3 is not installed."""
    if find_spec("stable_baselines3") is None:
        raise KinemimicError("expected stable-baselines3, found none; pip install 'kinemimic[baselines]'")
