"""The summary counts every claim once."""

from __future__ import annotations

import pytest

from kinemimic.evaluate.paper.claims.claim import CONFIRMED, LARGER, SHORT, SMALLER, UNSURE
from kinemimic.evaluate.paper.claims.summary import counts, is_worse, our_best

VERDICTS = {
    "better": ["better"],
    "confirmed": [
        CONFIRMED, LARGER, SMALLER, "confirmed: DDPG falls undisturbed", f"{SMALLER} as a ratio: 1",
    ],
    "setting": ["as in the paper", "other: the preset paper has the printed one"],
    "point": ["earlier", "later"],
    "worse": [
        "worse", "worse: PPO falls undisturbed", "contradicted", "contradicted: does not converge",
        "not confirmed", "not confirmed: both fall", "undecided: the interval contains 0", UNSURE,
    ],
    "incomparable": ["not comparable: measured on another machine"],
    "none": ["", SHORT, "no comparison: DDPG falls undisturbed"],
}  # fmt: skip


def test_every_verdict_is_counted_once_and_in_its_place() -> None:
    found = counts([{"verdict": verdict} for own in VERDICTS.values() for verdict in own])
    assert [number for number, _ in found] == [len(own) for own in VERDICTS.values()]
    assert found[1][1] == "confirmed, 2 of them smaller"
    assert found[2][1] == "settings, 1 of them other than in the paper"


@pytest.mark.parametrize("kind", VERDICTS)
def test_only_what_is_against_us_or_uncertain_is_marked(kind: str) -> None:
    assert {is_worse(verdict) for verdict in VERDICTS[kind]} == {kind == "worse"}


def test_our_best_stands_only_where_the_verdict_is_against_us() -> None:
    claim = {"best": {"value": 5.17, "policy": "PPO, robust"}, "unit": "%", "verdict": "worse"}
    assert our_best(claim) == "5.2\u00a0% (PPO, robust)"
    assert our_best({**claim, "verdict": "better"}) == our_best({**claim, "best": None}) == ""
