"""The claims as Markdown, for docs/results-paper.md.

The number of claims per outcome, and every claim with a verdict.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from kinemimic.evaluate.paper.claims.claim import (
    BETTER,
    CONFIRMED,
    CONTRADICTED,
    EARLIER,
    INCOMPARABLE,
    LATER,
    NOT_CONFIRMED,
    OTHER,
    SAME,
    SMALLER,
    UNSURE,
    WORSE,
    between,
    formatted,
)

Row = Mapping[str, Any]


def is_worse(verdict: str) -> bool:
    """Whether a verdict is against us, or uncertain."""
    against = (WORSE, NOT_CONFIRMED, CONTRADICTED, "undecided")
    return verdict == UNSURE or verdict.startswith(against)


def counts(claims: Sequence[Row]) -> tuple[tuple[int, str], ...]:
    """The number of claims per outcome, each with a label."""
    verdicts = [claim["verdict"] for claim in claims]
    better, leads = verdicts.count(BETTER), sum(v.startswith(CONFIRMED) for v in verdicts)
    smaller = sum(v.startswith(SMALLER) for v in verdicts)
    same = verdicts.count(SAME)
    other = sum(v.startswith(OTHER) for v in verdicts)
    moved = sum(v in (EARLIER, LATER) for v in verdicts)
    worse = sum(map(is_worse, verdicts))
    incomparable = sum(v.startswith(INCOMPARABLE) for v in verdicts)
    known = better + leads + same + other + moved + worse + incomparable
    return (
        (better, "numbers better than the paper's"),
        (leads, f"confirmed, {smaller} of them smaller"),
        (same + other, f"settings, {other} of them other than in the paper"),
        (moved, "points on an axis, earlier or later than in the paper"),
        (worse, "worse, not confirmed or uncertain"),
        (incomparable, "not comparable, for the reason given"),
        (len(verdicts) - known, "without a verdict"),
    )


def ours_with_interval(claim: Row) -> str:
    """Our number with its unit and, if there is one, its 95 % interval."""
    text = formatted(claim["ours"], claim["unit"])
    if claim["low"] is None:
        return text
    return f"{text} ({between(claim['low'], claim['high'], claim['unit'])})"


def our_best(claim: Row) -> str:
    """The best of our policies that ship, where the verdict is against us."""
    if claim["best"] is None or not is_worse(claim["verdict"]):
        return ""
    return f"{formatted(claim['best']['value'], claim['unit'])} ({claim['best']['policy']})"


def markdown(claims: Sequence[Row]) -> str:
    """Counts, and a table of the claims that could be compared."""
    lines = [f"- {number} {label}" for number, label in counts(claims)]
    lines += [
        "",
        "| | claim | paper | here (95 % interval) | our best | verdict |",
        "|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {claim['figure']} | {claim['what']} | {formatted(claim['paper'], claim['unit'])} "
        f"| {ours_with_interval(claim)} | {our_best(claim)} | {claim['verdict']} |"
        for claim in claims
        if claim["verdict"] and (claim["ours"] is not None or claim["verdict"].startswith(CONFIRMED))
    ]
    return "\n".join(lines).replace("\u00a0", " ") + "\n"
