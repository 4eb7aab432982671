"""What the paper's sections 4.1 and 4.2 claim in numbers, ours beside them, and who is ahead.

Of training in `claims_learning.py`; here, of what befalls those that were trained. "PPO ahead of X by"
compares leads; everything else compares the numbers themselves.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from kinemimic.evaluate.claim import Better, Claim, Failing
from kinemimic.evaluate.claims_learning import EPISODE, losses, rewards, settings
from kinemimic.evaluate.comparison import Comparison
from kinemimic.evaluate.study_plan import AMONG, BALL, PPO, RIVALS, SEVERAL

Row = Mapping[str, Any]


def claims(comparison: Comparison, contests: Sequence[Row], rooms: Sequence[Row], times: Row) -> list[Claim]:
    """Every number of both sections, in the paper's sequence.

    contests: of `contest.py`; rooms: of `rooms.py`; times: of `processing_times.py`.
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


# Figure, scenario, and what is printed: of PPO, ahead of DDPG, ahead of A2C.
_DIPS: Sequence[tuple[str, str, float | None, float, float]] = (
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
    by = {(row["contender"], row["scenario"]): row for row in contests}

    def ahead(name: str, scenario: str, figure: str, among: str = "") -> dict[str, Any]:
        """`ours` by how much a contender's figure is above PPO's, or None, why, and by whose failure."""
        ours, theirs = (by[one + among, scenario] for one in (PPO, name))
        told: dict[str, Any] = {"unequal": ours["samples"] > theirs["samples"]}
        lacking = [
            (row, one) for row, one in ((ours, PPO), (theirs, name)) if _figure_of(row, figure) is None
        ]
        if not lacking:
            return {**told, "ours": _figure_of(theirs, figure) - _figure_of(ours, figure)}
        lead = _standing(ours, figure) - _standing(theirs, figure)
        failing: Failing = "theirs" if lead > 0 else "ours" if lead < 0 else "both"
        reason = "; ".join(_why(row, one, figure) for row, one in lacking)
        return {**told, "ours": None, "reason": reason, "failing": failing}

    dip = (
        "median over the trials of the largest loss of reward against an undisturbed twin, share of the "
        "largest reward"
    )
    share = 100.0 / EPISODE
    for figure, scenario, printed, *leads in _DIPS:
        if printed is not None:
            row = by[PPO, scenario]
            ours, what = _percent(_figure_of(row, "dip")), "PPO's largest loss of reward"
            reason = _why(row, PPO, "dip")
            yield Claim(figure, what, dip, "%", share * printed, ours, "less", reason, "ours")
        for name, lead in zip(RIVALS, leads, strict=True):
            found = ahead(name, scenario, "dip")
            found["ours"] = _percent(found["ours"])
            what = f"PPO loses less than {name} by"
            yield Claim(figure, what, dip, "%", share * lead, better="lead", **found)
    back = (
        "median over the trials of the time from the first difference until the reward stays within 5 % of "
        "the largest reward below the twin's"
    )
    for name, lead in zip(RIVALS, (0.9, 0.6), strict=True):
        found = ahead(name, BALL, "typical_recovery_s")
        yield Claim("Fig. 11a", f"PPO recovers before {name} by", back, "s", lead, better="lead", **found)
    fall = (
        "median over the trials of the time from the first difference to the fall, where the reward becomes "
        "0; several obstacles: of those trained among them"
    )
    for figure, scenario, *leads in _FALLS:
        for name, lead in zip(RIVALS, leads, strict=True):
            found = ahead(name, scenario, "typical_fall_s", AMONG if scenario == SEVERAL else "")
            found["ours"] = None if found["ours"] is None else -found["ours"]
            what = f"PPO's reward is 0 later than {name}'s by"
            yield Claim(figure, what, fall, "s", lead, better="lead", **found)


def _walks(row: Row) -> bool:
    """Whether most of the undisturbed twins did not fall."""
    return bool(row["twins_fallen"] <= row["trials"] / 2)


def _figure_of(row: Row, figure: str) -> Any:
    """The dip's median or a typical time; None where a contender cannot even walk."""
    if not _walks(row):
        return None
    return row["dip"]["median"] if figure == "dip" else row[figure]


def _standing(row: Row, figure: str) -> int:
    """0 for who cannot walk; who never falls stands above who does, who never recovers below."""
    if not _walks(row):
        return 0
    never = _figure_of(row, figure) is None
    return (2 if never else 1) if figure == "typical_fall_s" else (1 if never else 2)


def _why(row: Row, name: str, figure: str) -> str:
    """Why there is no such figure."""
    return f"{name} {_HAS_NO[figure] if _walks(row) else 'falls by itself'}"


_HAS_NO = {
    "dip": "is not touched",
    "typical_recovery_s": "mostly does not recover",
    "typical_fall_s": "mostly does not fall",
}


def _percent(share: float | None) -> float | None:
    return None if share is None else 100.0 * share


def _fits(rooms: Sequence[Row]) -> Iterator[Claim]:
    (ours,) = (row for row in rooms if row["contender"] == PPO)
    how = (
        "R² of simulated against reference angle (the loop made of the capture, not the capture itself) over "
        "500 frames, nothing credited after a fall, mean of both sides, median of the rooms"
    )
    for figure, joint, printed in (("Fig. 12a", "knee", 0.914), ("Fig. 12b", "hip", 0.932)):
        yield Claim(figure, f"fit of the {joint}s", how, "", printed, ours[joint]["r2_upright"], "more")
    gap = "largest difference of either hip from its reference over 500 frames, median of the rooms"
    yield Claim("Fig. 12b", "largest gap at the hip", gap, "°", 2.3, ours["hip"]["max_gap_deg"], "less")
    where = "its frame in the room that is the median"
    yield Claim("Fig. 12b", "frame of that gap", where, "frame", 410, ours["shown"]["gap_frame"], "neither")


_MISSING = "stable-baselines3 is missing"


def _times(times: Row) -> Iterator[Claim]:
    how = (
        "processor time of one gradient step of actor and critic, the paper's networks, one thread. PPO is "
        "ours, with gradients written out by hand; DDPG is stable-baselines3's, which also draws its batch "
        "from memory and normalises it. Faster by: stable-baselines3's PPO against its DDPG, like with like"
    )
    better: Better
    net, printed = times["nets"][-1]["algorithms"], times["paper"]
    for k, samples in enumerate(times["samples"]):
        of = f"for {samples:,} samples"
        for name, better in ((PPO, "less"), ("DDPG", "neither")):
            told, found = printed[name.lower()], net[name.lower()]
            for figure, what in (("mean_ms", f"{name} {of}"), ("deviation_ms", f"{name} {of}, deviation")):
                here = found and found["update"][figure][k]
                yield Claim("Tab. 2", what, how, "ms", told[figure][k], here, better, _MISSING)
        ahead = printed["ddpg"]["mean_ms"][k] - printed["ppo"]["mean_ms"][k]
        lead = net["ddpg"] and net["ddpg"]["update"]["mean_ms"][k] - net["sb3-ppo"]["update"]["mean_ms"][k]
        what = f"PPO faster than DDPG {of} by"
        yield Claim("Tab. 2", what, how, "ms", ahead, lead, "lead", _MISSING)
