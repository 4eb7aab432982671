"""A policy learns recoveries: the searches that are stored, and what is kept."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.recovery import learning
from kinemimic.train.recovery.learning import SEARCHES, Taught, learn_recoveries, phases_of
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.sim.engines import resolve

Trained = tuple[Policy, TrainConfig]


def learned(walk: Motion, trained: Trained, run: Path, workers: int = 1) -> Taught:
    return learn_recoveries(walk, *trained, run, workers=workers, engine=resolve("auto"))


def test_phases_are_those_of_half_a_cycle_where_the_policy_mirrors(walk: Motion, trained: Trained) -> None:
    config = trained[1]
    np.testing.assert_allclose(phases_of(walk, config, 4), [0.125, 0.375])
    whole = replace(config, env=replace(config.env, mirror=False))
    np.testing.assert_allclose(phases_of(walk, whole, 4), [0.125, 0.375, 0.625, 0.875])


def test_searches_are_done_once_and_the_result_is_the_same(
    walk: Motion, trained: Trained, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(learning, "_TEST_PHASES", 1)
    monkeypatch.setattr(learning, "_TEST_FORCES", (150.0,))
    first = learned(walk, trained, tmp_path)
    assert first.record["searches"] == 1
    assert first.record["samples"] > 12 * 30  # at least those before the pushes
    assert first.record["survived_by_round"][0] <= max(first.record["survived_by_round"])

    def never(*_: object, **__: object) -> None:
        raise AssertionError("a search that is stored")

    monkeypatch.setattr(learning, "parallel_map", never)
    second = learned(walk, trained, tmp_path)
    assert second.record == first.record
    for (a, _), (b, _) in zip(first.policy.layers, second.policy.layers, strict=True):
        np.testing.assert_array_equal(a, b)
    # Of another seed, nothing is stored.
    with pytest.raises(AssertionError, match="a search that is stored"):
        learned(walk, (trained[0], replace(trained[1], seed=7)), tmp_path)


@pytest.mark.parametrize("content", ["[]", "{}", "not JSON", None])
def test_a_file_of_searches_that_is_none_is_not_used(content: str | None, tmp_path: Path) -> None:
    path = tmp_path / SEARCHES
    if content is not None:
        path.write_text(content)
    assert learning._stored(path, {"policy": "x"}) == []


def test_a_stored_search_of_another_policy_is_not_used(tmp_path: Path) -> None:
    path = tmp_path / SEARCHES
    path.write_text(json.dumps({"policy": "x", "found": []}))
    assert learning._stored(path, {"policy": "x"}) == []
    one = {"phase": 0.5, "direction": 1.0, "before": 0.0, "after": 1.0, "samples": 9, "knots": [[0.25]]}
    path.write_text(json.dumps({"policy": "x", "found": [one]}))
    (found,) = learning._stored(path, {"policy": "x"})
    assert found.knots.tolist() == [[0.25]]
    assert learning._stored(path, {"policy": "y"}) == []


def test_a_policy_that_survives_fewer_pushes_is_not_kept(
    walk: Motion, trained: Trained, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shares = iter([0.5, 0.4])
    monkeypatch.setattr(learning, "push_survival", lambda *_: next(shares))
    found = learned(walk, trained, tmp_path)
    assert found.policy is trained[0]
    assert found.record["survived_by_round"] == [0.5, 0.4]
