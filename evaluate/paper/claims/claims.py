"""The numeric claims of the paper's sections 4.1 and 4.2, with our numbers.

Claims about training are in `learning.py`; this module has those about trained policies. "PPO ahead of
X by" compares leads; all other claims compare the numbers themselves.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.evaluate.compare.comparison import Comparison
from kinemimic.evaluate.compare.learning_curves import interval, resamples
from kinemimic.evaluate.paper.claims.claim import NOT_CONFIRMED, UNTRAINED, Best, Better, Claim, Failing
from kinemimic.evaluate.paper.claims.learning import EPISODE, TRAINED, losses, rewards, settings
from kinemimic.evaluate.paper.experiments.plan import AMONG, BALL, BASELINES, OURS, PPO, SEVERAL
from kinemimic.pipeline.arrays import Array

Row = Mapping[str, Any]


def claims(comparison: Comparison, contests: Sequence[Row], rooms: Sequence[Row], times: Row) -> list[Claim]:
    """Every number of both sections, in the paper's order.

    contests: rows of `head_to_head.py`; rooms: of `room_walks.py`; times: of `processing_times.py`.
    """
    made = [
        *rewards(comparison),
        *losses(comparison),
        *_disturbances(contests),
        *_fits(rooms),
    ]
    return [*settings(comparison), *sorted(made, key=_figure), *_times(times)]


def _figure(claim: Claim) -> tuple[int, str]:
    digits = claim.figure.removeprefix("Fig. ").rstrip("ab")
    return int(digits), claim.figure


# Figure, scenario, and the printed values: PPO's loss, lead over DDPG, lead over A2C.
_LOSSES: Sequence[tuple[str, str, float | None, float, float]] = (
    ("Fig. 9a", "pull-forward", 62.4, 123.5, 31.2),
    ("Fig. 9b", "pull-backward", 53.1, 112.7, 30.6),
    ("Fig. 11a", BALL, None, 47.5, 6.7),
)
_FALLS: Sequence[tuple[str, str, float, float]] = (
    ("Fig. 10a", "leg-force", 0.7, 1.3),
    ("Fig. 10b", "arm-torque", 1.1, 1.8),
    ("Fig. 11b", SEVERAL, 0.8, 2.1),
)


def _disturbances(contests: Sequence[Row]) -> Iterator[Claim]:
    by = {(row["policy"], row["scenario"]): row for row in contests}
    loss = (
        "largest drop of the mean reward below the mean of the undisturbed control runs, over trials whose "
        "control run does not fall (for a lead: neither algorithm's); share of the maximum reward"
    )
    share = 100.0 / EPISODE
    for figure, scenario, printed, *leads in _LOSSES:
        if printed is not None:
            row, what = by[PPO, scenario], "PPO's largest drop of reward"
            found = _of(row["loss"], row["loss"]["share"], 100.0) if _walks(row) else {"ours": None}
            drops = {name: by[name, scenario] for name in OURS if _walks(by[name, scenario])}
            least = min((Best(100.0 * row["loss"]["share"], name) for name, row in drops.items()),
                        key=lambda best: best.value, default=None)  # fmt: skip
            yield Claim(figure, what, loss, "%", share * printed, better="less", failing="ours",
                        reason=f"{PPO} falls undisturbed", best=least, **found)  # fmt: skip
        for name, lead in zip(BASELINES, leads, strict=True):
            found = _ahead(by[PPO, scenario], by[name, scenario], name, "loss", 100.0)
            yield _lead(figure, f"PPO's drop smaller than {name}'s by", loss, "%", share * lead, found)
    back = (
        "median, over trials that affect both humanoids and in which neither control run falls, of the time "
        "from the first difference until the reward stays within 5 % of the maximum below the control run's"
    )
    for name, lead in zip(BASELINES, (0.9, 0.6), strict=True):
        found = _ahead(by[PPO, BALL], by[name, BALL], name, "recovery_s")
        yield _lead("Fig. 11a", f"PPO recovers before {name} by", back, "s", lead, found)
    fall = (
        "median, over trials that affect both humanoids and in which neither control run falls, of the time "
        "from the first difference to the fall, where the reward becomes 0; several obstacles: policies "
        "trained among them"
    )
    for figure, scenario, *leads in _FALLS:
        among = AMONG if scenario == SEVERAL else ""
        for name, lead in zip(BASELINES, leads, strict=True):
            theirs = by.get((name + among, scenario))
            found = (
                {"ours": None, "reason": UNTRAINED}
                if theirs is None
                else _ahead(by[PPO + among, scenario], theirs, name, "fall_s")
            )
            yield _lead(figure, f"PPO's reward is 0 later than {name}'s by", fall, "s", lead, found)


def _walks(row: Row) -> bool:
    """Whether most of the undisturbed control runs did not fall."""
    return bool(row["controls_fallen"] <= row["trials"] / 2)


def _of(result: Row, value: float | None, scale: float) -> dict[str, Any]:
    """`ours` and its interval, from a result of `lead.py`."""
    parts = {"ours": value, "low": result["low"], "high": result["high"]}
    return {key: None if one is None else scale * one for key, one in parts.items()}


_NEVER = {"recovery_s": "mostly does not recover", "fall_s": "mostly does not fall"}


def _ahead(ours: Row, theirs: Row, name: str, measure: str, scale: float = 1.0) -> dict[str, Any]:
    """PPO's lead over a baseline, or the reason why there is none and which algorithm failed."""
    result: dict[str, Any] = {"unequal": ours["samples"] > theirs["samples"], "ours": None}
    if not (_walks(ours) and _walks(theirs)):
        return {**result, **_fallen(ours, theirs, name)}
    lead = theirs["lead"][measure]
    result["trials"] = lead["trials"]
    if lead["ahead"] is not None:
        return {**result, **_of(lead, lead["ahead"], scale)}
    if not lead["trials"]:
        return {**result, "reason": "no comparison: no common trial"}
    never = [one for one, key in ((PPO, "ours"), (name, "theirs")) if lead[key] is None]
    if len(never) == 2:
        return {**result, "reason": f"{NOT_CONFIRMED}: both {_NEVER[measure].replace('does', 'do')}"}
    # Without a median, the interval decides; in it, "never" counts as the end of the trial.
    failing: Failing = "both"
    if lead["low"] is not None and not lead["low"] <= 0.0 <= lead["high"]:
        failing = "theirs" if lead["low"] > 0.0 else "ours"
    chance = "undecided: " if failing == "both" else ""
    return {**result, "reason": f"{chance}{never[0]} {_NEVER[measure]}", "failing": failing}


def _fallen(ours: Row, theirs: Row, name: str) -> dict[str, Any]:
    """Why there is no lead where a policy falls undisturbed: it cannot show the effect of a disturbance.

    That a baseline does not walk after as many samples as in the paper is a result of its own.
    """
    if _walks(theirs):
        return {"reason": f"{PPO} falls undisturbed", "failing": "ours"}
    if theirs["samples"] < TRAINED:
        return {"reason": f"no comparison: {name} falls undisturbed"}
    after = f"undisturbed after {theirs['samples']:,} samples"
    if not _walks(ours):
        return {"reason": f"{NOT_CONFIRMED}: both fall {after}"}
    of = f"{theirs['seeds_fallen']} of {theirs['seeds']} seeds"
    return {"reason": f"{name} falls {after}, {of}", "failing": "theirs"}


def _lead(figure: str, what: str, formula: str, unit: str, paper: float, found: dict[str, Any]) -> Claim:
    """The claim that PPO is ahead. found: result of `_ahead`. A single trial gets no verdict."""
    trials = found.pop("trials", None)
    of = "" if trials is None else f", in {trials} trials"
    better: Better = "neither" if found["ours"] is not None and found["low"] is None else "lead"
    return Claim(figure, f"{what}{of}", formula, unit, paper, better=better, **found)


def _fits(rooms: Sequence[Row]) -> Iterator[Claim]:
    (ours,) = (row for row in rooms if row["policy"] == PPO)
    shipped = [row for row in rooms if row["policy"] in OURS]
    how = (
        "R² of the simulated against the reference angle (the loop, not the capture itself) over 500 frames, "
        "no credit after a fall, mean of both sides, median of the walks through the rooms by all seeds' "
        "policies, with its 95 % bootstrap interval"
    )
    of = f"median of {ours['trials']} walks, in {ours['upright']} upright to the end"
    for figure, joint, printed in (("Fig. 12a", "knee", 0.914), ("Fig. 12b", "hip", 0.932)):
        low, high = _of_median(
            np.array([walk[joint]["r2_upright"] for walk in ours["walks"]]),
            np.array([walk["seed"] for walk in ours["walks"]]),
        )
        better: Better = "neither" if low is None else "more"
        best = max((Best(row[joint]["r2_upright"], row["policy"]) for row in shipped),
                   key=lambda one: one.value)  # fmt: skip
        yield Claim(figure, f"fit of the {joint}s, {of}", how, "", printed, ours[joint]["r2_upright"], better,
                    low=low, high=high, best=best)  # fmt: skip
    gap = (
        "largest difference of either hip from its reference over 500 frames, falls included, median of the "
        "walks"
    )
    best = min((Best(row["hip"]["max_gap_deg"], row["policy"]) for row in shipped), key=lambda one: one.value)
    yield Claim("Fig. 12b", "largest gap at the hip", gap, "°", 2.3, ours["hip"]["max_gap_deg"], "less",
                best=best)  # fmt: skip
    where = "frame of the largest gap in the walk with the median fit"
    yield Claim("Fig. 12b", "frame of that gap", where, "frame", 410, ours["shown"]["gap_frame"],
                "incomparable", "the paper's walk is not published")  # fmt: skip


def _of_median(values: Array, seeds: NDArray[np.int64]) -> tuple[float, float] | tuple[None, None]:
    """Bootstrap interval of the median of values (N,) of these seeds (N,); none for a single value."""
    if len(values) < 2:
        return None, None
    return interval(np.array([np.median(np.repeat(values, drawn)) for drawn in resamples(seeds)]))


_MISSING = "stable-baselines3 is not installed"
_OTHER_MACHINE = "measured on another machine; the paper does not say what it timed"


def _times(times: Row) -> Iterator[Claim]:
    how = (
        "processor time of one gradient step of actor and critic, the paper's networks, one thread. PPO is "
        "ours, with hand-written gradients; DDPG has stable-baselines3's networks and our steps, which "
        "include sampling the batch from the replay buffer and normalising it"
    )
    faster = (
        "the same for stable-baselines3's PPO and for DDPG with our gradient steps. "
        "Leads are compared by the ratio of the two times, "
        "because milliseconds depend on the machine"
    )
    net, printed = times["nets"][-1]["algorithms"], times["paper"]
    ppo, ddpg = (net[name] and net[name]["update"] for name in ("sb3-ppo", "ddpg"))
    for k, samples in enumerate(times["samples"]):
        of = f"for {samples:,} samples"
        for name in ("PPO", "DDPG"):
            theirs, found = printed[name.lower()], net[name.lower()]
            for what, which in ((of, "mean_ms"), (f"{of}, deviation", "deviation_ms")):
                yield Claim("Tab. 2", f"{name} {what}", how, "ms", theirs[which][k],
                            found and found["update"][which][k], "incomparable", _OTHER_MACHINE)  # fmt: skip
        other, own = (printed[name]["mean_ms"][k] for name in ("ddpg", "ppo"))
        here = ddpg and ddpg["mean_ms"][k] - ppo["mean_ms"][k]
        sizes = ddpg and (other / own, ddpg["mean_ms"][k] / ppo["mean_ms"][k])
        yield Claim("Tab. 2", f"PPO faster than DDPG {of} by", faster, "ms", other - own, here, "lead",
                    _MISSING, sizes=sizes)  # fmt: skip
    steeper = (
        "difference of the exponents of n fitted to the three times (stable-baselines3 for both), with the "
        "95 % interval from the deviation of the repeats; the paper's from its printed times, "
        "Lower for PPO, Higher for DDPG"
    )
    growth = printed["ddpg"]["growth"] - printed["ppo"]["growth"]
    here = ddpg and ddpg["growth"] - ppo["growth"]
    low = high = None
    if ddpg and here is not None:
        far = 1.96 * float(np.hypot(_exponent_error(times, ppo), _exponent_error(times, ddpg)))
        low, high = here - far, here + far
    yield Claim("Tab. 2", "DDPG's time grows with a power of n higher by", steeper, "", growth, here, "lead",
                _MISSING, low=low, high=high)  # fmt: skip


def _exponent_error(times: Row, one: Row) -> float:
    """Standard error of the slope of log time over log n, from the standard errors of the mean times."""
    x = np.log(times["samples"])
    errors = np.array(one["deviation_ms"]) / np.array(one["mean_ms"]) / np.sqrt(times["repeats"])
    away = x - x.mean()
    return float(np.sqrt((away**2 * errors**2).sum()) / (away**2).sum())
