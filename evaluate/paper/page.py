"""The study's page: the paper's section 4 claim by claim, then its figures in its sequence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

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
    told,
)
from kinemimic.evaluate.paper.sections import disturbances, processing, room, training
from kinemimic.evaluate.scoring.report import SIMULATED_BANNER
from kinemimic.pipeline.cli.html import made_from, page, table
from kinemimic.pipeline.cli.picture import Draw

Row = Mapping[str, Any]


def study_page(comparison: Comparison, content: Row, drawings: Mapping[str, Draw]) -> str:
    """The page as HTML. content: of study.json; drawings: by the names that `study` saves them under."""
    sections = [
        _head(content, simulated=any(task.get("simulated") for task in comparison.content["tasks"].values())),
        _claims(content["claims"]),
        *training(comparison, drawings),
        *disturbances(content["contests"], drawings),
        *room(content["rooms"], drawings),
        *processing(content["times"], drawings),
        made_from(content["provenance"]),
    ]
    return page("kinemimic: the paper's experiments", "\n".join(sections))


def _head(content: Row, *, simulated: bool) -> str:
    verdicts = [claim["verdict"] for claim in content["claims"]]
    better, leads = verdicts.count(BETTER), sum(v.startswith(CONFIRMED) for v in verdicts)
    worse = sum(map(_is_worse, verdicts))
    tiles = (
        (better, "numbers better than the paper's"),
        (leads, f"leads confirmed, {verdicts.count(SMALLER)} of them smaller"),
        (worse, "worse, not confirmed, or not for certain"),
        (len(verdicts) - better - leads - worse, "without a comparison"),
    )
    return (
        "<h1>The paper's experiments</h1>"
        '<p class="lead">Sections 4.1 and 4.2 again, on one figure: PPO, DDPG and actor-critic (A2C) learn '
        "the same task; then forces, torques, obstacles and a room befall each of them, draw for draw.</p>"
        + (SIMULATED_BANNER if simulated else "")
        + '<div class="tiles">'
        + "".join(f"<div><b>{value}</b><span>{label}</span></div>" for value, label in tiles)
        + "</div>"
    )


def _is_worse(verdict: str) -> bool:
    return verdict in (NOT_CONFIRMED, CONTRADICTED, UNSURE) or verdict.startswith((WORSE, "undecided"))


def _claims(claims: Sequence[Row]) -> str:
    rows = []
    for claim in claims:
        unit = claim["unit"]
        verdict = claim["verdict"]
        if _is_worse(verdict):
            verdict = f"<strong>{verdict}</strong>"
        paper, ours = (told(claim[key], unit) for key in ("paper", "ours"))
        if claim["low"] is not None:
            ours += f" ({between(claim['low'], claim['high'], unit)})"
        rows.append([claim["figure"], escape(claim["what"]), paper, ours, verdict])
    formulas = dict.fromkeys(f"{claim['figure'].rstrip('ab')}: {claim['formula']}" for claim in claims)
    return (
        "<h2>Claim by claim</h2>"
        + table(
            ["", "claim", "paper", "here", ""],
            rows,
            "The paper says neither what its rewards could have come to, nor how strong its forces were, "
            "what machine it ran on, or how it computed fit, loss, recovery, convergence and loss. We take "
            "its rewards as shares of 500, one for each of its frames; forces are ours, formulas are "
            "below. So sizes compare by order of magnitude at best; that PPO is ahead of its rivals, and "
            "by how much, compares better. In brackets: 95 % interval, of what is learnt by resampling "
            "seeds, of three no wider than their range, else by resampling trials or rooms of one policy of "
            "each algorithm; of Fig. 8's leads and of Tab. 2 as told below. A lead whose interval holds 0 is "
            "undecided; after more samples than the rival had, or fewer than the paper's, it is not called "
            "larger or smaller. Fig. 7b names its two rivals in no order: we take DDPG first, as elsewhere. "
            "PPO is kinemimic's, whose settings are not the paper's; DDPG and A2C are stable-baselines3's, "
            "with settings that a small search preferred.",
            words=(1, 4),
        )
        + "<ul>"
        + "".join(f"<li>{escape(line)}</li>" for line in formulas)
        + "</ul>"
    )
