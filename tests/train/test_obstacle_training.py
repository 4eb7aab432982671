"""A training among obstacles: to its end through joining, and interrupted."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from peers.killing import without_clock
from peers.small_training import ROUND
from peers.trackers import write_idle_tracker
from safetensors.numpy import load_file

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash, read_json, write_text
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train import command as stage
from kinemimic.train import settings
from kinemimic.train.config.from_tracker import from_tracker
from kinemimic.train.config.joining import Joining
from kinemimic.train.ppo.ppo import PpoAlgorithm
from kinemimic.train.recovery import joining, learning
from kinemimic.train.recovery.pupils_file import PUPILS
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.runner.checkpoint import CHECKPOINT

BUDGET = 3 * ROUND


@pytest.fixture
def train(tmp_path: Path, motion: Motion, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], Any]]:
    """Trains in a folder of this name; rounds are small, and so are joining and its tests."""
    quick = {
        "num_envs": 4, "horizon": 16, "minibatch": 32, "epochs": 2, "strength": ((0, 1.0),),
        "joining": Joining(rounds=2, humanoids=4),
    }  # fmt: skip
    monkeypatch.setattr(settings, "from_tracker", lambda *given: replace(from_tracker(*given), **quick))
    monkeypatch.setattr(settings, "LEAST", BUDGET)
    monkeypatch.setattr(joining, "_TESTS", 4)
    monkeypatch.setattr(learning, "_TEST_FORCES", (100.0,))
    monkeypatch.setattr(learning, "_TEST_PHASES", 1)
    monkeypatch.setattr(joining, "parallel_map", lambda task, items, *, workers: [task(one) for one in items])
    tracker = write_idle_tracker(tmp_path / "tracker")
    earlier = signal.signal(signal.SIGINT, signal.default_int_handler)

    def trained(name: str) -> dict[str, Any]:
        write_text(tmp_path / name / "motion.json", motion_to_json(motion))
        return stage.train(
            tmp_path / name, start=str(tracker), preset_name="obstacles", budget=BUDGET, seed=1, workers=1
        )

    yield trained
    signal.signal(signal.SIGINT, earlier)


def interrupted(patched: pytest.MonkeyPatch, owner: object, name: str, number: int) -> None:
    """Ctrl-C before this call, from one, of a function."""
    calls, called = iter(range(1, 1000)), getattr(owner, name)

    def interrupting(*given: Any, **named: Any) -> Any:
        if next(calls) == number:
            signal.raise_signal(signal.SIGINT)
        return called(*given, **named)

    patched.setattr(owner, name, interrupting)


def test_it_ends_with_the_best_pupil_of_joining(train: Callable[[str], Any], tmp_path: Path) -> None:
    record = train("run")
    assert record["finished"]
    assert record["samples"] == BUDGET
    assert set(record["joining"]) == {"first", "trained", "survived_by_round"}
    assert len(record["joining"]["survived_by_round"]) == 2
    assert read_json(tmp_path / "run" / "policy.json")["joining"] == record["joining"]
    policy, stored = Policy.load(tmp_path / "run" / "policy.safetensors")
    assert stored["config"]["env"]["observed_obstacles"] == 3
    # It is a pupil, not the policy that PPO came to.
    best = load_file(tmp_path / "run" / CHECKPOINT)
    assert any(not np.array_equal(best[f"best.{name}"], tensor) for name, tensor in policy.tensors().items())


@pytest.mark.parametrize(
    ("owner", "name", "seeds"),
    [(PpoAlgorithm, "update", [1, 2]), (joining, "fitted", [2])],
    ids=["in the second round of PPO", "in the second of joining"],
)
def test_interrupted_and_resumed_it_comes_to_the_same_policy(
    owner: object,
    name: str,
    seeds: list[int],
    train: Callable[[str], Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    straight, fits, fitted = train("straight"), [], joining.fitted
    with monkeypatch.context() as patched:
        interrupted(patched, owner, name, 2)
        with pytest.raises(KeyboardInterrupt):
            train("cut")
    assert (tmp_path / "cut" / CHECKPOINT).exists()
    assert (tmp_path / "cut" / PUPILS).exists() == (owner is joining)
    monkeypatch.setattr(joining, "fitted", lambda *given: fits.append(given[3]) or fitted(*given))
    assert train("cut")["joining"] == straight["joining"]
    assert fits == seeds  # of the rounds of joining that were left
    assert without_clock(tmp_path / "cut" / "policy.json") == without_clock(tmp_path / "straight/policy.json")
    ours, theirs = (file_hash(tmp_path / one / "policy.safetensors") for one in ("cut", "straight"))
    assert ours == theirs


def test_a_motion_that_ends_is_refused(motion: Motion) -> None:
    ending = replace(motion, cyclic=False, cycle_offset=np.zeros(3))
    with pytest.raises(
        KinemimicError, match="--preset obstacles: expected a walk or run that repeats itself"
    ):
        settings.settings_for(ending, start="robust_walk", preset_name="obstacles")
