"""What `compare` left is read again, and what ships of it is enough."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from kinemimic.evaluate.comparison import Comparison
from kinemimic.pipeline.errors import KinemimicError


def test_the_middle_seed_is_that_of_the_median_return(compared: Callable[..., Path]) -> None:
    comparison = Comparison.load(compared(returns=(0.9, 0.1, 0.5)))
    assert comparison.middle("walk", "default")["seed"] == 2
    even = Comparison.load(compared("even", returns=(0.9, 0.1, 0.5, 0.6)))
    assert even.middle("walk", "default")["seed"] == 2


def test_a_contender_is_the_middle_seed(compared: Callable[..., Path]) -> None:
    """Each seed's policy corrects by a hundredth of its number."""
    comparison = Comparison.load(compared(returns=(0.9, 0.1, 0.5)))
    one = comparison.contender("walk", "ddpg", "DDPG")
    assert one.name == "DDPG"
    assert one.config.preset == "ddpg"
    assert one.policy.layers[-1][1] == pytest.approx(0.02)


def test_what_is_published_is_a_comparison_with_a_seed_of_each(
    compared: Callable[..., Path], tmp_path: Path
) -> None:
    whole = Comparison.load(compared(returns=(0.9, 0.1, 0.5)))
    whole.publish(tmp_path / "ships")
    ships = Comparison.load(tmp_path / "ships")
    assert ships.content == whole.content
    ours, theirs = (of.contender("run", "a2c", "A2C") for of in (ships, whole))
    assert ours.sha256 == theirs.sha256
    assert len(list((tmp_path / "ships").rglob("*.safetensors"))) == 12


def test_what_is_missing_is_one_line(compared: Callable[..., Path], tmp_path: Path) -> None:
    folder = compared()
    comparison = Comparison.load(folder)
    with pytest.raises(KinemimicError, match="found none of robust on walk; `kinemimic compare`"):
        comparison.expect(["walk"], ["default", "robust"])
    comparison.expect(["walk", "run"], ["default", "ddpg"])
    (folder / "run" / "motion.json").write_bytes((folder / "walk" / "motion.json").read_bytes())
    with pytest.raises(KinemimicError, match="expected a policy of run's motion"):
        comparison.contender("run", "default", "PPO")
    with pytest.raises(KinemimicError, match="found no file; `make comparison` trains"):
        Comparison.load(tmp_path)
    (tmp_path / "compare.json").write_text(json.dumps({"schema": 7}))
    with pytest.raises(KinemimicError, match="expected what `kinemimic compare` writes"):
        Comparison.load(tmp_path)
