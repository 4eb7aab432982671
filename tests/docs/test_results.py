"""What results.md says of the paper's experiments is what the study measured.

study_claims.json holds the claims of a full `make study`; after another one, replace it, and the block in
results.md with the study's claims.md.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from printed.blocks import ROOT

from kinemimic.evaluate.compare.comparison import SHIPPED, Comparison
from kinemimic.evaluate.paper.claims_learning import losses, rewards, settings
from kinemimic.evaluate.paper.summary import markdown

MEASURED: list[dict[str, Any]] = json.loads(Path(__file__).with_name("study_claims.json").read_text())


def test_the_page_has_the_table_of_the_study() -> None:
    page = (ROOT / "docs" / "results.md").read_text()
    block = page.partition("<!-- claims -->\n")[2].partition("<!-- end of claims -->")[0]
    assert block == markdown(MEASURED)


def test_the_claims_about_training_are_those_of_the_shipped_comparison() -> None:
    comparison = Comparison.load(SHIPPED)
    computed = [*settings(comparison), *rewards(comparison), *losses(comparison)]
    measured = {(one["figure"], one["what"]): one for one in MEASURED}
    assert len(computed) > 20
    for claim in computed:
        row = measured[claim.figure, claim.what]
        assert row["verdict"] == claim.verdict
        for key in ("paper", "ours", "low", "high"):
            assert row[key] == pytest.approx(getattr(claim, key)), (claim.figure, claim.what, key)
