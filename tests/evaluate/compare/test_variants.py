"""Variants: each changes what it says of its base, and nothing of the task."""

from __future__ import annotations

from dataclasses import replace

import pytest

from kinemimic.evaluate.compare.variants import ABLATION, SEARCH, ablation, search
from kinemimic.train.config.config import PRESETS, TrainConfig


def test_every_change_of_the_ablation_changes_one_thing() -> None:
    variants = ablation()
    base = variants.pop("default")
    assert base == PRESETS["default"]
    assert variants.keys() == ABLATION.keys()
    for name, config in variants.items():
        assert config.preset == name
        assert replace(config, preset="default") != base, f"{name} is the default"


@pytest.mark.parametrize("baseline", SEARCH)
def test_a_search_changes_one_or_two_things_of_a_rival_and_never_its_task(baseline: str) -> None:
    variants = search(baseline)
    base = variants.pop(baseline)
    assert base == PRESETS[baseline]
    assert 6 <= len(variants) <= 10
    assert base.baseline is not None
    for name, config in variants.items():
        assert config.preset == name
        assert name.removeprefix(f"{baseline}-") in SEARCH[baseline]
        assert (config.env, config.scales, config.budget) == (base.env, base.scales, base.budget)
        assert config.batch == base.batch
        assert type(config.baseline) is type(base.baseline)
        assert replace(config, preset=baseline) != base, f"{name} is the preset"
        assert TrainConfig.from_json(config.to_json()) == config
