"""`make run`: the default capture becomes a walk with the scores of the README. Takes 15 min on two cores."""

from __future__ import annotations

from pathlib import Path

import pytest

from kinemimic.evaluate.workflow.run import run


@pytest.mark.slow
def test_the_default_capture_becomes_a_walk(tmp_path: Path) -> None:
    scores = run(None, tmp_path, quiet=True).scores
    assert scores["survival"]["frames"] == scores["survival"]["of"] == 600
    assert scores["survival"]["phases"] == 13
    for joint in ("knee", "hip"):
        # Without a fall from phase 0, both are the same.
        assert scores["fit"][joint]["r2"] == scores["fit"][joint]["r2_upright"] >= 0.98
        assert scores["no_policy"]["fit"][joint]["r2_upright"] < 0.1
    assert scores["root"]["speed_ratio"] == pytest.approx(1.0, abs=0.02)
    assert scores["capture"]["simulated"]
