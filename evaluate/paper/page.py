"""The study's page: the claims of the paper's section 4, then its figures in the same order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from kinemimic.evaluate.compare.comparison import Comparison
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
from kinemimic.evaluate.paper.sections import disturbances, processing, room, training
from kinemimic.pipeline.cli.html import render
from kinemimic.pipeline.cli.picture import Draw

Row = Mapping[str, Any]


def study_page(comparison: Comparison, content: Row, drawings: Mapping[str, Draw]) -> str:
    """The page as HTML. content: of study.json; drawings: by the names that `study` saves them under."""
    return render(
        Path(__file__).with_name("templates") / "study.html",
        title="kinemimic: the paper's experiments",
        simulated=any(task.get("simulated") for task in comparison.content["tasks"].values()),
        drawings=drawings,
        provenance=content["provenance"],
        **_claims(content["claims"]),
        **training(comparison),
        **disturbances(content["head_to_head"], drawings),
        **room(content["rooms"]),
        **processing(content["times"]),
    )


def _is_worse(verdict: str) -> bool:
    return verdict in (NOT_CONFIRMED, CONTRADICTED, UNSURE) or verdict.startswith((WORSE, "undecided"))


def _claims(claims: Sequence[Row]) -> dict[str, Any]:
    """A row for each claim, how many came out how, and the formulas."""
    verdicts = [claim["verdict"] for claim in claims]
    better, leads = verdicts.count(BETTER), sum(v.startswith(CONFIRMED) for v in verdicts)
    worse = sum(map(_is_worse, verdicts))
    rows = []
    for claim in claims:
        unit, verdict = claim["unit"], claim["verdict"]
        if _is_worse(verdict):
            verdict = Markup("<strong>{}</strong>").format(verdict)
        paper, ours = (formatted(claim[key], unit) for key in ("paper", "ours"))
        if claim["low"] is not None:
            ours += f" ({between(claim['low'], claim['high'], unit)})"
        rows.append([claim["figure"], claim["what"], paper, ours, verdict])
    return {
        "claims": rows,
        "summary": (
            (better, "numbers better than the paper's"),
            (leads, f"leads confirmed, {verdicts.count(SMALLER)} of them smaller"),
            (worse, "worse, not confirmed or uncertain"),
            (len(verdicts) - better - leads - worse, "without a comparison"),
        ),
        "formulas": list(
            dict.fromkeys(f"{claim['figure'].rstrip('ab')}: {claim['formula']}" for claim in claims)
        ),
    }
