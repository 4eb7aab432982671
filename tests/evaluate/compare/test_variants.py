"""Variants: each changes what it says of its base, and nothing of the task."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import pytest

from kinemimic.evaluate.compare.variants import ABLATION, SEARCH, ablation, search
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.presets import PRESETS

# Variants that change several settings: one rule, one size of the batch.
SEVERAL = {
    "kl-penalty": {"kl_penalty", "adapt_rate", "kl_target"},
    **{
        f"{name}-batch-1024": {"baseline.batch", "baseline.updates_per_sample"}
        for name in ("ddpg", "td3", "sac")
    },
    "a2c-envs-64": {"num_envs", "horizon"},
}


def settings(config: TrainConfig) -> dict[str, Any]:
    """Every setting by its path, such as env.mirror."""

    def flat(value: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
        for key, item in value.items():
            if isinstance(item, Mapping) and item:
                yield from flat(item, f"{prefix}{key}.")
            else:
                yield prefix + key, item

    return dict(flat(config.to_json(), ""))


def changed(config: TrainConfig, base: TrainConfig) -> set[str]:
    """Paths of the settings in which two configurations differ, their names aside."""
    ours, theirs = settings(config), settings(base)
    return {path for path in ours.keys() | theirs.keys() if ours.get(path) != theirs.get(path)} - {"preset"}


def declared(changes: Mapping[str, Any]) -> set[str]:
    """Paths of the settings that a variant names."""
    return {
        f"{key}.{name}" if isinstance(value, Mapping) else key
        for key, value in changes.items()
        for name in (value if isinstance(value, Mapping) else (None,))
    }


def test_every_change_of_the_ablation_changes_one_thing() -> None:
    variants = ablation()
    base = variants.pop("default")
    assert base == PRESETS["default"]
    assert variants.keys() == ABLATION.keys()
    for name, config in variants.items():
        assert config.preset == name
        paths = changed(config, base)
        assert paths == declared(ABLATION[name])
        assert paths == SEVERAL.get(name, paths) and (len(paths) == 1 or name in SEVERAL), name


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
        paths = changed(config, base)
        assert paths == declared(SEARCH[baseline][name.removeprefix(f"{baseline}-")])
        assert paths == SEVERAL.get(name, paths) and (len(paths) == 1 or name in SEVERAL), name
        assert TrainConfig.from_json(config.to_json()) == config
