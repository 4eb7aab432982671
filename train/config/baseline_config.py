"""Settings of the rivals: stable-baselines3's algorithms in PPO's place, everything else being equal.

Equal is what `TrainConfig` says of all: task, rewards and their schedule, hidden layers, discount, samples of
a round, budget; exploration and figures too, but where a preset says otherwise (`config.py`). What only our
PPO has (from `minibatch` to `critic_rate`, `gae_lambda`, the entropy's weight) a rival does not look at: it
has its own here.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import ClassVar, Literal

from msgspec import Struct

from kinemimic.pipeline.errors import KinemimicError

Activation = Literal["tanh", "relu"]


class Ddpg(Struct, frozen=True, forbid_unknown_fields=True, tag_field="algorithm", tag="ddpg"):
    """Deep deterministic policy gradient (Lillicrap et al. 2016).

    actor_rate, critic_rate: of Adam; batch: samples of a gradient step; train_every: control steps of all
    figures between two trainings; updates_per_sample: gradient steps for each sample taken; tau: share of the
    networks that their targets take over in a gradient step; buffer: samples remembered; warm_up: samples
    before the first gradient step, in whole rounds; bound: largest action, by which the actor's tanh is
    multiplied.
    """

    # As published: a critic that learns ten times as fast as the actor that trusts it.
    actor_rate: float = 1e-4
    critic_rate: float = 1e-3
    batch: int = 256
    train_every: int = 1
    # PPO looks at a sample eight times, this at thirty-two.
    updates_per_sample: float = 0.125
    tau: float = 0.005
    # 0.7 GB. What is remembered is told anew under the reward in force (`rival_memory.py`), so it may be old.
    buffer: int = 300_000
    # With its own small actions and noise, not the uniform ones that are customary: those fall at once.
    warm_up: int = 8192
    # Half a radian in the legs: the walks and the run that ship ask for 0.46 at most. With twice that, the
    # actor goes further to where its critic has never been, and falls sooner.
    bound: float = 0.5
    activation: Activation = "relu"

    @property
    def steps(self) -> int:
        """Control steps of all figures between two trainings."""
        return self.train_every


class A2c(Struct, frozen=True, forbid_unknown_fields=True, tag_field="algorithm", tag="a2c"):
    """Advantage actor-critic, synchronous (Mnih et al. 2016): one gradient step on what was just sampled.

    actor_rate, critic_rate: of the optimiser; n_steps: control steps of every figure for a gradient step;
    gae_lambda: of the advantages; max_grad_norm: of both networks' gradient together; use_rms_prop: else
    Adam; normalize_advantage: to zero mean and unit variance in every gradient step.
    """

    # A tenth of our PPO's first: nothing clips a step, and as the noise shrinks to a quarter the same step
    # moves the policy sixteen times as far (KL).
    actor_rate: float = 3e-5
    critic_rate: float = 1e-3
    # Twice the gradient steps for as many samples: the search preferred it, three seeds do not tell.
    n_steps: int = 4
    gae_lambda: float = 0.95
    max_grad_norm: float = 0.5
    # As published, it begins with steps ten times too long: Adam corrects its means for their beginning.
    use_rms_prop: bool = False
    normalize_advantage: bool = True
    activation: Activation = "tanh"
    # Of the mean of a Gaussian: none.
    bound: ClassVar[None] = None

    @property
    def steps(self) -> int:
        """Control steps of all figures between two trainings."""
        return self.n_steps


class StablePpo(Struct, frozen=True, forbid_unknown_fields=True, tag_field="algorithm", tag="ppo"):
    """PPO (Schulman et al. 2017) as others wrote it, on rounds as ours has them.

    actor_rate, critic_rate: of Adam; batch: samples of a gradient step; passes: over a round; clip: of the
    ratio; gae_lambda: of the advantages; max_grad_norm: of both networks' gradient together.
    """

    # Constant, where ours is steered to a KL divergence of 0.1 in a round: 1e-4 goes twice as far with the
    # noise of the beginning, and that of the end makes sixteen times as much of every step. Its own remedy,
    # to stop a round's passes at a divergence, stops the critic too, which then learns too little.
    actor_rate: float = 5e-5
    critic_rate: float = 1e-3
    batch: int = 512
    epochs: int = 8
    clip: float = 0.2
    gae_lambda: float = 0.95
    max_grad_norm: float = 1.0
    # The search preferred it to tanh and to any other change; three seeds do not tell.
    activation: Activation = "relu"
    bound: ClassVar[None] = None

    @property
    def steps(self) -> int:
        """1: a rollout is a whole round, of whatever length."""
        return 1


Baseline = Ddpg | A2c | StablePpo


def require_package() -> None:
    """KinemimicError where stable-baselines3 is not installed."""
    if find_spec("stable_baselines3") is None:
        raise KinemimicError("expected stable-baselines3, found none; pip install 'kinemimic[rivals]'")
