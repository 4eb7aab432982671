"""The claims as Markdown, for docs/results.md.

The number of claims per outcome, and every claim with a verdict.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from kinemimic.evaluate.paper.claim import (
    BETTER,
    CONFIRMED,
    CONTRADICTED,
    NOT_CONFIRMED,
    SMALLER,
    UNSURE,
    WORSE,
    between,
    formatted,
)

Row = Mapping[str, Any]


def is_worse(verdict: str) -> bool:
    """Whether a verdict is against us, or uncertain."""
    return verdict in (NOT_CONFIRMED, CONTRADICTED, UNSURE) or verdict.startswith((WORSE, "undecided"))


def counts(claims: Sequence[Row]) -> tuple[tuple[int, str], ...]:
    """The number of claims per outcome, each with a label."""
    verdicts = [claim["verdict"] for claim in claims]
    better, leads = verdicts.count(BETTER), sum(v.startswith(CONFIRMED) for v in verdicts)
    worse = sum(map(is_worse, verdicts))
    return (
        (better, "numbers better than the paper's"),
        (leads, f"leads confirmed, {verdicts.count(SMALLER)} of them smaller"),
        (worse, "worse, not confirmed or uncertain"),
        (len(verdicts) - better - leads - worse, "without a comparison"),
    )


def ours_with_interval(claim: Row) -> str:
    """Our number with its unit and, if there is one, its 95 % interval."""
    text = formatted(claim["ours"], claim["unit"])
    if claim["low"] is None:
        return text
    return f"{text} ({between(claim['low'], claim['high'], claim['unit'])})"


def markdown(claims: Sequence[Row]) -> str:
    """Counts, and a table of the claims that could be compared."""
    lines = [f"- {number} {label}" for number, label in counts(claims)]
    lines += ["", "| | claim | paper | here (95 % interval) | verdict |", "|---|---|---|---|---|"]
    lines += [
        f"| {claim['figure']} | {claim['what']} | {formatted(claim['paper'], claim['unit'])} "
        f"| {ours_with_interval(claim)} | {claim['verdict']} |"
        for claim in claims
        if claim["verdict"] and (claim["ours"] is not None or claim["verdict"].startswith(CONFIRMED))
    ]
    return "\n".join(lines).replace("\u00a0", " ") + "\n"
