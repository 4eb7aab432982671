"""The study's page: the claims of the paper's section 4, then its figures in the same order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from kinemimic.evaluate.compare.comparison import Comparison
from kinemimic.evaluate.paper.claims.claim import formatted
from kinemimic.evaluate.paper.claims.summary import counts, is_worse, our_best, ours_with_interval
from kinemimic.evaluate.paper.page.sections import disturbances, processing, room, training
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


def _claims(claims: Sequence[Row]) -> dict[str, Any]:
    """A row for each claim, the number of claims per outcome, and the formulas."""
    rows = []
    for claim in claims:
        verdict = claim["verdict"]
        if is_worse(verdict):
            verdict = Markup("<strong>{}</strong>").format(verdict)
        paper = formatted(claim["paper"], claim["unit"])
        rows.append(
            [claim["figure"], claim["what"], paper, ours_with_interval(claim), our_best(claim), verdict]
        )
    return {
        "claims": rows,
        "summary": counts(claims),
        "formulas": list(
            dict.fromkeys(f"{claim['figure'].rstrip('ab')}: {claim['formula']}" for claim in claims)
        ),
    }
