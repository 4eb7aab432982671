"""What the results pages say of the paper's experiments, and of a Kinect's accuracy, is what was measured.

study_claims.json holds the claims of a full `make study`; after another one, replace it, and the block in
results-paper.md with the study's claims.md. sensor_accuracy.json is the accuracy.json of `make
sensor-accuracy`, and the block in results-accuracy.md its table.md.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from bench import sensor_accuracy
from printed.blocks import ROOT

from kinemimic.evaluate.compare.comparison import SHIPPED, Comparison
from kinemimic.evaluate.paper.claims.learning import losses, rewards, settings
from kinemimic.evaluate.paper.claims.summary import markdown

MEASURED: list[dict[str, Any]] = json.loads(Path(__file__).with_name("study_claims.json").read_text())


ACCURACY: list[dict[str, Any]] = json.loads(Path(__file__).with_name("sensor_accuracy.json").read_text())


def test_the_page_has_the_table_of_the_study() -> None:
    page = (ROOT / "docs" / "results-paper.md").read_text()
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


def test_the_page_has_the_table_of_the_sensors_accuracy() -> None:
    page = (ROOT / "docs" / "results-accuracy.md").read_text()
    block = page.partition("<!-- sensor accuracy -->\n")[2].partition("<!-- end of sensor accuracy -->")[0]
    assert block == sensor_accuracy.markdown(ACCURACY)


def test_the_sensors_accuracy_is_as_recorded_and_cleaning_improves_it(captures: Path) -> None:
    rows = sensor_accuracy.table(sensor_accuracy.pairs(captures))
    assert len(rows) == len(ACCURACY) == 12
    for row, recorded in zip(rows, ACCURACY, strict=True):
        where = (row.movement, row.joint)
        assert where == (recorded["movement"], recorded["joint"])
        for key in ("rmse", "bias", "peak", "step"):
            assert getattr(row, key) == pytest.approx(recorded[key], abs=0.02), (where, key)
        # The jump of the lunge's knee: see results-accuracy.md.
        assert row.rmse[1] < row.rmse[0] + (0.04 if where == ("inline lunge", "knee") else 0.001), where
        assert row.step[1] < 0.8 * row.step[0], where
