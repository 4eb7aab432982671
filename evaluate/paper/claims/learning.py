"""Section 4.1: the paper's settings, returns, convergence and losses, with our numbers.

The paper does not state its maximum return. We assume 500, one per frame, and give its rewards as shares of
that; ours are shares of the possible maximum.
"""

from __future__ import annotations

from collections.abc import Iterator

from kinemimic.evaluate.compare.comparison import Comparison
from kinemimic.evaluate.compare.learning_curves import Estimate, ahead, converged_at, interquartile
from kinemimic.evaluate.paper.claims.claim import LOSS, SETTING, UNTRAINED, Best, Better, Claim
from kinemimic.evaluate.paper.experiments.plan import (
    BASELINES,
    LONGER,
    OBSTACLES,
    OURS,
    PPO,
    RUN,
    VARIANTS,
    WALK,
)
from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.evaluate.policies.shipped import RECORD
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.rollout.policy import read_record

EPISODE = 500.0  # the paper's maximum return, assumed
TRAINED = 1_000_000  # samples, of the paper's Fig. 7 and 8


def settings(comparison: Comparison) -> Iterator[Claim]:
    """The numbers of section 4.1's first paragraph; ours are from the preset used for PPO."""
    ours = TrainConfig.from_json(comparison.content["provenance"]["config"]["variants"][VARIANTS[PPO]])
    how = (
        "of the preset compared here, which trains faster on this humanoid than the paper's settings; for "
        "those (--preset paper) see docs/results-paper.md"
    )
    initial = ", initial" if ours.adapt_rate else ""
    for what, printed, name in (
        (f"learning rate of the policy{initial}", 3e-4, "actor_rate"),
        ("learning rate of the value function", 1e-3, "critic_rate"),
        ("discount", 0.99, "discount"),
        ("λ of the generalized advantage estimate", 0.95, "gae_lambda"),
        ("batch, samples", 4096, "batch"),
        ("epochs per batch", 10, "epochs"),
        ("clip range of the ratio", 0.2, "clip"),
        ("entropy coefficient, initial", 0.01, "entropy"),
        ("its decay per round, %", 5.0, "entropy_decay"),
    ):
        here, theirs = (float(getattr(one, name)) for one in (ours, PRESETS["paper"]))
        if name == "entropy_decay":
            here, theirs = (round(100.0 * (1.0 - factor), 9) for factor in (here, theirs))
        why = f"the preset paper has {'the printed one' if theirs == printed else f'{theirs:g}'}"
        yield Claim("Sec. 4.1", what, how, SETTING, printed, here, "setting", why)


def returns(comparison: Comparison, task: str, variant: str) -> Estimate:
    """Interquartile mean of the maximum return over the seeds, in %."""
    return interquartile([100.0 * row["return"] for row in comparison.cells(task, variant)])


def converged(comparison: Comparison, task: str, variant: str) -> Estimate:
    """Samples at which the return converged, over the seeds that converged."""
    rows = comparison.cells(task, variant)
    return interquartile([v for row in rows if (v := row["converged_samples"]) is not None])


def least_loss(comparison: Comparison, task: str, variant: str, budget: int | None = None) -> Estimate:
    """Minimum, up to a budget, of the seeds' interquartile mean of the critic's loss on normalised returns,
    with its interval."""
    curve = comparison.curve(task, variant, "critic_loss")
    # A budget ends with a whole round, so its last evaluation may come some samples later.
    last = max((row["samples"] for row in comparison.cells(task, variant, budget)), default=0)
    rows = [row for row in curve if row["samples"] <= last]
    if not rows:
        return Estimate(None, None, None, 0)
    least = min(rows, key=lambda row: float(row["mean"]))
    return Estimate(least["mean"], least["low"], least["high"], least["n"])


def last_loss(comparison: Comparison, task: str, variant: str) -> float | None:
    """The critic's loss at the last evaluation."""
    curve = comparison.curve(task, variant, "critic_loss")
    return float(curve[-1]["mean"]) if curve else None


def loss_converged(comparison: Comparison, task: str, variant: str) -> float | None:
    """Samples after which the critic's loss has completed 95 % of its total decrease."""
    curve = comparison.curve(task, variant, "critic_loss")
    losses = [row["mean"] for row in curve]
    if not losses:
        return None
    return converged_at([row["samples"] for row in curve], [max(losses) - loss for loss in losses])


def rewards(comparison: Comparison) -> Iterator[Claim]:
    """Fig. 7: maximum returns, leads, and convergence."""
    best = "maximum return of an evaluation, interquartile mean over the seeds, share of the possible maximum"
    where = (
        "samples after which the return, smoothed over three evaluations, stays within 5 % of its maximum, "
        "for at least the last quarter of the training; interquartile mean over the seeds that converged"
    )
    share = 100.0 / EPISODE
    for task, figure, printed in (
        (WALK, "Fig. 7a", {"PPO": 463.0, "DDPG": 43.5, "A2C": 307.2}),
        (RUN, "Fig. 7b", {"DDPG": 312.5, "A2C": 95.8}),
    ):
        if PPO in printed:
            estimate, what = returns(comparison, task, VARIANTS[PPO]), "PPO's maximum reward"
            longer = read_record(POLICIES / OURS[LONGER] / RECORD)["best"]["reward"]
            yield Claim(figure, what, best, "%", share * printed[PPO], estimate.mean, "more",
                        low=estimate.low, high=estimate.high, best=Best(100.0 * longer, LONGER))  # fmt: skip
        for name, variant in BASELINES.items():
            if not comparison.cells(task, variant):
                yield Claim(figure, f"PPO ahead of {name} by", best, "%", share * printed[name], None, "lead",
                            UNTRAINED)  # fmt: skip
                continue
            at = comparison.shared(task, VARIANTS[PPO], variant)
            ours, theirs = (
                [100.0 * row["return"] for row in comparison.cells(task, one, at)]
                for one in (VARIANTS[PPO], variant)
            )
            estimate, what = ahead(ours, theirs), f"PPO ahead of {name} by, after {at:,} samples"
            yield Claim(figure, what, best, "%", share * printed[name], estimate.mean, _lead(estimate.low),
                        low=estimate.low, high=estimate.high, short=at < TRAINED)  # fmt: skip
    for task, figure, printed in (
        (WALK, "Fig. 7a", {"PPO": 8e5, "A2C": 5e5, "DDPG": 10e5}),
        (RUN, "Fig. 7b", {"PPO": 10e5, "DDPG": 10e5}),
    ):
        for name, samples in printed.items():
            variant = VARIANTS[name]
            if not comparison.cells(task, variant):
                yield Claim(figure, f"{name} converges at", where, "samples", samples, None, "neither",
                            UNTRAINED)  # fmt: skip
                continue
            estimate, last = converged(comparison, task, variant), _last(comparison, task, variant)
            seeds = f"{estimate.n} of {len(comparison.cells(task, variant))} seeds"
            what = f"{name} converges, of {last:,} samples ({seeds}), at"
            yield Claim(figure, what, where, "samples", samples, estimate.mean, "point",
                        "still rising, or does not stay near its maximum",
                        low=estimate.low, high=estimate.high, short=last < TRAINED)  # fmt: skip


def _lead(low: float | None) -> Better:
    """A lead without an interval is from one seed and gets no verdict."""
    return "neither" if low is None else "lead"


def _minus(one: float | None, other: float | None) -> float | None:
    return None if one is None or other is None else one - other


def _last(comparison: Comparison, task: str, variant: str) -> int:
    return max((row["budget"] for row in comparison.cells(task, variant)), default=0)


def losses(comparison: Comparison) -> Iterator[Claim]:
    """Fig. 8: the critics' losses, PPO's leads, and where its loss converges."""
    how = (
        "critic's mean squared error over the variance of its targets, minimum of the seeds' interquartile "
        "mean, which occurs before any policy walks; a lead's interval is from the nearest to the farthest "
        "ends of both intervals"
    )
    where = (
        "samples after which the critic's loss, smoothed over three evaluations, has completed 95 % of its "
        "decrease"
    )
    for task, figure, printed in (
        (WALK, "Fig. 8a", {"DDPG": 0.038, "A2C": 0.059}),
        (OBSTACLES, "Fig. 8b", {"PPO": 0.007, "DDPG": 0.045, "A2C": 0.062}),
    ):
        ppo = VARIANTS[PPO]
        if PPO in printed:
            estimate = least_loss(comparison, task, ppo)
            yield Claim(figure, "PPO's minimum loss", how, LOSS, printed[PPO], estimate.mean, "less",
                        low=estimate.low, high=estimate.high)  # fmt: skip
        found = loss_converged(comparison, task, ppo)
        what = "PPO's loss converges at" + ("" if task == WALK else " (printed: basically unchanged)")
        yield Claim(figure, what, where, "samples", 8e5, found, "point", "does not converge",
                    short=_last(comparison, task, ppo) < TRAINED)  # fmt: skip
        for name, variant in BASELINES.items():
            if not comparison.cells(task, variant):
                yield Claim(figure, f"PPO's minimum loss below {name}'s by", how, LOSS, printed[name], None,
                            "lead", UNTRAINED)  # fmt: skip
                continue
            at = comparison.shared(task, ppo, variant)
            ours, theirs = (least_loss(comparison, task, one, at) for one in (ppo, variant))
            # The lead is certain where the two intervals do not overlap.
            lead, low = _minus(theirs.mean, ours.mean), _minus(theirs.low, ours.high)
            high = _minus(theirs.high, ours.low)
            what = f"PPO's minimum loss below {name}'s by, after {at:,} samples"
            yield Claim(figure, what, how, LOSS, printed[name], lead, _lead(low),
                        low=low, high=high, short=at < TRAINED)  # fmt: skip
