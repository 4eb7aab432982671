"""Section 4.1: what the paper prints of settings, returns, convergence and losses, and ours beside it.

The paper does not say what its rewards could have come to at most. We take 500, one for each of its frames,
and tell its rewards as shares of that, as ours are of the largest that ours could earn.
"""

from __future__ import annotations

from collections.abc import Iterator

from kinemimic.evaluate.compare.comparison import Comparison
from kinemimic.evaluate.compare.learning_curves import Estimate, ahead, converged_at, interquartile
from kinemimic.evaluate.paper.claim import LOSS, SETTING, Better, Claim
from kinemimic.evaluate.paper.plan import OBSTACLES, PPO, BASELINES, RUN, VARIANTS, WALK
from kinemimic.train.config.config import TrainConfig

EPISODE = 500.0  # the largest return, as we take it
TRAINED = 1_000_000  # samples, of the paper's Fig. 7 and 8


def settings(comparison: Comparison) -> Iterator[Claim]:
    """The numbers of section 4.1's first paragraph; ours are of the preset that stands for PPO."""
    ours = TrainConfig.from_json(comparison.content["provenance"]["config"]["variants"][VARIANTS[PPO]])
    how = (
        "of the preset that is compared here, which learns sooner on our figure than what the paper prints; "
        "what that comes to (--preset paper) stands in docs/results.md"
    )
    for what, printed, found in (
        ("learning rate of the policy" + (", at first" if ours.adapt_rate else ""), 3e-4, ours.actor_rate),
        ("learning rate of the value function", 1e-3, ours.critic_rate),
        ("discount", 0.99, ours.discount),
        ("parameter of the generalized advantage estimate", 0.95, ours.gae_lambda),
        ("batch, samples", 4096, ours.batch),
        ("passes over a batch", 10, ours.epochs),
        ("clip of the ratio", 0.2, ours.clip),
        ("weight of the entropy, at first", 0.01, ours.entropy),
        ("its decay in each round, %", 5.0, 100.0 * (1.0 - ours.entropy_decay)),
    ):
        yield Claim("Sec. 4.1", what, how, SETTING, printed, found, "neither", "none")


def returns(comparison: Comparison, task: str, variant: str) -> Estimate:
    """Over the seeds the interquartile mean of the largest return; %."""
    return interquartile([100.0 * row["return"] for row in comparison.cells(task, variant)])


def converged(comparison: Comparison, task: str, variant: str) -> Estimate:
    """Over the seeds that have come to that, the samples at which the return has converged."""
    rows = comparison.cells(task, variant)
    return interquartile([v for row in rows if (v := row["converged_samples"]) is not None])


def least_loss(comparison: Comparison, task: str, variant: str, budget: int | None = None) -> Estimate:
    """Least, up to a budget, of the seeds' interquartile mean of the critic's loss on normalised returns, and
    its interval there."""
    curve = comparison.curve(task, variant, "critic_loss")
    # A budget ends with a whole round, and so does its last trial: some samples later.
    last = max((row["samples"] for row in comparison.cells(task, variant, budget)), default=0)
    rows = [row for row in curve if row["samples"] <= last]
    if not rows:
        return Estimate(None, None, None, 0)
    least = min(rows, key=lambda row: float(row["mean"]))
    return Estimate(least["mean"], least["low"], least["high"], least["n"])


def last_loss(comparison: Comparison, task: str, variant: str) -> float | None:
    """Of the last trial."""
    curve = comparison.curve(task, variant, "critic_loss")
    return float(curve[-1]["mean"]) if curve else None


def loss_converged(comparison: Comparison, task: str, variant: str) -> float | None:
    """Samples from which on the critic's loss has done 95 % of its way down for good."""
    curve = comparison.curve(task, variant, "critic_loss")
    losses = [row["mean"] for row in curve]
    if not losses:
        return None
    return converged_at([row["samples"] for row in curve], [max(losses) - loss for loss in losses])


def rewards(comparison: Comparison) -> Iterator[Claim]:
    """Fig. 7: largest returns, leads, and where they converge."""
    best = "largest return of a trial, interquartile mean over the seeds, share of the largest possible"
    where = (
        "samples from which the return, smoothed over three trials, stays within 5 % of its largest, and for "
        "the last quarter of the training at least; interquartile mean over the seeds that have come to "
        "that. No verdict: who trains for less could only converge sooner"
    )
    share = 100.0 / EPISODE
    for task, figure, printed in (
        (WALK, "Fig. 7a", {"PPO": 463.0, "DDPG": 43.5, "A2C": 307.2}),
        (RUN, "Fig. 7b", {"DDPG": 312.5, "A2C": 95.8}),
    ):
        if PPO in printed:
            told, what = returns(comparison, task, VARIANTS[PPO]), "PPO's largest reward"
            yield Claim(figure, what, best, "%", share * printed[PPO], told.mean, "more",
                        low=told.low, high=told.high)  # fmt: skip
        for name, variant in BASELINES.items():
            at = comparison.shared(task, VARIANTS[PPO], variant)
            ours, theirs = (
                [100.0 * row["return"] for row in comparison.cells(task, one, at)]
                for one in (VARIANTS[PPO], variant)
            )
            told, what = ahead(ours, theirs), f"PPO ahead of {name} by, after {at:,} samples"
            yield Claim(figure, what, best, "%", share * printed[name], told.mean, _lead(told.low),
                        low=told.low, high=told.high, short=at < TRAINED)  # fmt: skip
    for task, figure, printed in (
        (WALK, "Fig. 7a", {"PPO": 8e5, "A2C": 5e5, "DDPG": 10e5}),
        (RUN, "Fig. 7b", {"PPO": 10e5, "DDPG": 10e5}),
    ):
        for name, samples in printed.items():
            variant = VARIANTS[name]
            told, last = converged(comparison, task, variant), _last(comparison, task, variant)
            seeds = f"{told.n} of {len(comparison.cells(task, variant))} seeds"
            what = f"{name} converges, of {last:,} samples ({seeds}), at"
            yield Claim(figure, what, where, "samples", samples, told.mean, "neither",
                        "still rises, or does not stay near its best",
                        low=told.low, high=told.high)  # fmt: skip


def _lead(low: float | None) -> Better:
    """A lead without an interval is of one seed, on which there is no verdict."""
    return "neither" if low is None else "lead"


def _minus(one: float | None, other: float | None) -> float | None:
    return None if one is None or other is None else one - other


def _last(comparison: Comparison, task: str, variant: str) -> int:
    return max((row["budget"] for row in comparison.cells(task, variant)), default=0)


def losses(comparison: Comparison) -> Iterator[Claim]:
    """Fig. 8: the critics' losses, their leads, and where PPO's converges."""
    how = (
        "critic's mean squared error over its targets' variance, least of the seeds' interquartile mean, "
        "which comes before anybody walks; of a lead, from the near ends of both intervals to the far ones"
    )
    where = (
        "samples from which on the critic's loss, smoothed over three trials, has done 95 % of its way down "
        "from the first trial's, which is large, so that this comes early: no verdict"
    )
    for task, figure, printed in (
        (WALK, "Fig. 8a", {"DDPG": 0.038, "A2C": 0.059}),
        (OBSTACLES, "Fig. 8b", {"PPO": 0.007, "DDPG": 0.045, "A2C": 0.062}),
    ):
        ppo = VARIANTS[PPO]
        if PPO in printed:
            told = least_loss(comparison, task, ppo)
            yield Claim(figure, "PPO's least loss", how, LOSS, printed[PPO], told.mean, "less",
                        low=told.low, high=told.high)  # fmt: skip
        found = loss_converged(comparison, task, ppo)
        what = "PPO's loss converges at" + ("" if task == WALK else " (printed: basically unchanged)")
        yield Claim(figure, what, where, "samples", 8e5, found, "neither", "does not stay down")
        for name, variant in BASELINES.items():
            at = comparison.shared(task, ppo, variant)
            ours, theirs = (least_loss(comparison, task, one, at) for one in (ppo, variant))
            # Apart for certain where their intervals are.
            lead, low = _minus(theirs.mean, ours.mean), _minus(theirs.low, ours.high)
            high = _minus(theirs.high, ours.low)
            what = f"PPO's least loss below {name}'s by, after {at:,} samples"
            yield Claim(figure, what, how, LOSS, printed[name], lead, _lead(low),
                        low=low, high=high, short=at < TRAINED)  # fmt: skip
