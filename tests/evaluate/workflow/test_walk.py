"""The promise of `make run`: the default capture becomes a walk. A quarter of an hour on two cores."""

from __future__ import annotations

from pathlib import Path

import pytest

from kinemimic.evaluate.workflow.run import run


@pytest.mark.slow
def test_the_default_capture_becomes_a_walk(tmp_path: Path) -> None:
    scores = run(None, tmp_path, quiet=True).scores
    assert scores["survival"]["frames"] == scores["survival"]["of"] == 600
    assert scores["survival"]["phases"] >= 11
    for joint in ("knee", "hip"):
        # The figure never falls from phase 0, so that both are the same there.
        assert scores["fit"][joint]["r2"] == scores["fit"][joint]["r2_upright"] >= 0.90
        assert scores["no_policy"]["fit"][joint]["r2_upright"] < 0.2
    assert 0.9 < scores["root"]["speed_ratio"] < 1.1
    assert scores["capture"]["simulated"]
