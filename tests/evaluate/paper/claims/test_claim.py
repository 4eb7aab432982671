"""A claim: what is called better, worse, a lead or not comparable, and how numbers are written."""

from __future__ import annotations

from typing import Any

import pytest

from kinemimic.evaluate.paper.claims.claim import (
    BETTER,
    CONFIRMED,
    CONTRADICTED,
    EARLIER,
    INCOMPARABLE,
    LARGER,
    LATER,
    LOSS,
    NOT_CONFIRMED,
    OTHER,
    SAME,
    SETTING,
    SHORT,
    SMALLER,
    UNDECIDED,
    UNEQUAL,
    UNSURE,
    WORSE,
    Better,
    Claim,
    between,
    formatted,
)


@pytest.mark.parametrize(
    ("better", "paper", "ours", "verdict"),
    [
        ("more", 0.914, 0.914, BETTER),
        ("more", 0.914, 0.913, WORSE),
        ("less", 2.3, 2.2, BETTER),
        ("less", 2.3, 2.4, WORSE),
        ("lead", 43.5, 50.0, LARGER),
        ("lead", 43.5, 0.1, SMALLER),
        ("lead", 43.5, 0.0, NOT_CONFIRMED),
        ("lead", 43.5, -1.0, NOT_CONFIRMED),
        ("setting", 0.2, 0.2, SAME),
        ("setting", 0.2, 0.3, f"{OTHER}: nobody walked"),
        ("point", 8e5, 9e5, LATER),
        ("point", 8e5, 7e5, EARLIER),
        ("point", 8e5, None, f"{CONTRADICTED}: nobody walked"),
        ("incomparable", 8e5, 7e5, f"{INCOMPARABLE}: nobody walked"),
        ("neither", 5e5, 9e5, ""),
        ("neither", 5e5, None, "nobody walked"),
        ("more", 0.914, None, f"{WORSE}: nobody walked"),
    ],
)
def test_the_verdict_is_that_of_the_numbers(
    better: Better, paper: float, ours: float | None, verdict: str
) -> None:
    assert Claim("Fig. 1", "", "", "", paper, ours, better, "nobody walked", "ours").verdict == verdict


@pytest.mark.parametrize(
    ("low", "unequal", "ours", "verdict"),
    [
        (1.0, False, 50.0, LARGER),
        (0.0, False, 50.0, UNDECIDED),
        (-1.0, True, 50.0, UNDECIDED),
        (1.0, True, 50.0, UNEQUAL),
        (None, True, 50.0, UNEQUAL),
        (-9.0, True, -1.0, NOT_CONFIRMED),
        (None, True, None, f"{UNEQUAL}: it falls"),
    ],
)
def test_a_lead_is_one_where_seeds_agree_and_samples_are_the_same(
    low: float | None, unequal: bool, ours: float | None, verdict: str
) -> None:
    claim = Claim("Fig. 1", "", "", "", 43.5, ours, "lead", "it falls", "theirs", low, 60.0, unequal)
    assert claim.verdict == verdict


@pytest.mark.parametrize(
    ("what", "verdict"),
    [
        ({"short": True}, SHORT),
        ({"better": "point", "short": True}, f"{INCOMPARABLE}: fewer samples than in the paper"),
        ({"better": "point", "low": 43.0, "high": 60.0}, CONFIRMED),
        ({"better": "point", "low": 49.0, "high": 60.0}, LATER),
        ({"low": -1.0, "high": 60.0, "short": True}, UNDECIDED),
        ({"sizes": (2.0, 1.9)}, f"{SMALLER} as a ratio: 1.90, in the paper 2.00"),
        ({"sizes": (2.0, 2.0)}, f"{LARGER} as a ratio: 2.00, in the paper 2.00"),
        ({"ours": -5.0, "low": -9.0, "high": -1.0}, CONTRADICTED),
        ({"ours": -5.0, "low": -9.0, "high": 0.0}, NOT_CONFIRMED),
        ({"better": "more", "low": 43.5, "high": 60.0}, BETTER),
        ({"better": "more", "low": 43.4, "high": 60.0}, UNSURE),
        ({"better": "less", "ours": 40.0, "low": 1.0, "high": 44.0}, UNSURE),
        ({"better": "less", "low": 1.0, "high": 60.0}, WORSE),
    ],
)
def test_what_is_not_certain_or_does_not_compare_is_called_so(what: dict[str, Any], verdict: str) -> None:
    of = {"figure": "Fig. 1", "what": "", "formula": "", "unit": "", "paper": 43.5, "ours": 50.0}
    assert Claim(**{**of, "better": "lead", **what}).verdict == verdict


def test_a_number_is_told_with_its_unit() -> None:
    assert formatted(3e-4, SETTING) == "0.0003"
    assert formatted(12.345, "%") == "12.3\u00a0%"
    assert formatted(812_345.6, "samples") == "812,346"
    assert formatted(None, "s") == "–"
    assert formatted(-0.00046, LOSS) == "−0.0005"
    assert formatted(0.914, "") == "0.914"
    assert between(1.04, 22.26, "%") == "1.0 to 22.3"
    assert between(65_536.0, 1e6, "samples") == "65,536 to 1,000,000"
