"""A training that joins policies: to its end, and interrupted."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from peers.killing import without_clock
from peers.teachers import write_teacher
from peers.trackers import write_idle_tracker

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash, write_text
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train import command as stage
from kinemimic.train import settings
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.config.from_tracker import BUDGETS, OBSTACLE_POLISH, from_tracker
from kinemimic.train.config.joining import Joining
from kinemimic.train.recovery import joining
from kinemimic.train.recovery.joining import lesson_samples
from kinemimic.train.recovery.pupils_file import PUPILS
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.runner.closing_words import closing_words

Train = Callable[[str], Any]


@pytest.fixture
def train(tmp_path: Path, motion: Motion, monkeypatch: pytest.MonkeyPatch) -> Iterator[Train]:
    """Trains in a folder of this name; lessons and tests are small."""
    small = Joining(rounds=2, humanoids=4)
    monkeypatch.setattr(settings, "from_tracker", lambda *given: replace(from_tracker(*given), joining=small))
    monkeypatch.setattr(joining, "_AMONG_OBSTACLES", 20)
    monkeypatch.setattr(joining, "parallel_map", lambda _, tests, *, workers: measured(tests))

    def measured(tests: list[joining._Test]) -> list[tuple[float, float]]:
        """The teachers help, and the last round is the best."""
        return [(0.5, 0.4 + 0.1 * k) for k in range(len(tests))]

    tracker = write_idle_tracker(tmp_path / "tracker")
    teachers = write_teacher(tmp_path / "teachers" / "policy.safetensors", motion, leans=0.05).parent
    earlier = signal.signal(signal.SIGINT, signal.default_int_handler)

    def trained(name: str, **options: Any) -> dict[str, Any]:
        write_text(tmp_path / name / "motion.json", motion_to_json(motion))
        start = {"start": str(tracker), "teachers": teachers, "preset_name": "obstacles", "seed": 1}
        return stage.train(tmp_path / name, **start, workers=1, **options)

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


def test_it_ends_with_the_best_pupil_of_joining(train: Train, tmp_path: Path) -> None:
    record = train("run")
    assert record["finished"]
    assert record["samples"] == lesson_samples(Joining(rounds=2, humanoids=4))
    assert set(record["joining"]) == {"teachers", "first", "first_and_teachers", "survived_by_round"}
    assert len(record["joining"]["survived_by_round"]) == 2
    assert len(record["evaluations"]) == 1
    assert record["best"] == record["evaluations"][0]
    assert set(record["seconds_by"]) == {"joining"}
    policy, stored = Policy.load(tmp_path / "run" / "policy.safetensors")
    assert stored["joining"] == record["joining"]
    assert stored["config"]["env"]["observed_obstacles"] == 3
    # It is a pupil of a teacher that leans, not the idle policy that it started from.
    assert any(bias.any() for _, bias in policy.layers)
    assert "best of 1 evaluation, after" in " ".join(closing_words(record, tmp_path / "run"))


def test_interrupted_and_resumed_it_comes_to_the_same_policy(
    train: Train, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    straight, fits, fitted = train("straight"), [], joining.fitted
    with monkeypatch.context() as patched:
        interrupted(patched, joining, "fitted", 2)
        with pytest.raises(KeyboardInterrupt):
            train("cut")
    assert (tmp_path / "cut" / PUPILS).exists()
    assert not (tmp_path / "cut" / "policy.json").exists()
    monkeypatch.setattr(joining, "fitted", lambda *given: fits.append(given[3]) or fitted(*given))
    assert train("cut")["joining"] == straight["joining"]
    assert fits == [2]  # of the round that was left
    assert without_clock(tmp_path / "cut" / "policy.json") == without_clock(tmp_path / "straight/policy.json")
    ours, theirs = (file_hash(tmp_path / one / "policy.safetensors") for one in ("cut", "straight"))
    assert ours == theirs
    train("cut", resume=False)
    assert fits == [2, 1, 2]


def test_its_lessons_have_no_limit_of_time_and_its_teachers_are_elsewhere(
    train: Train, tmp_path: Path
) -> None:
    with pytest.raises(KinemimicError, match="expected lessons of a fixed length here, found --minutes"):
        train("run", minutes=1.0)
    with pytest.raises(KinemimicError, match=r"expected policies outside of .*run, which training replaces"):
        train("teachers/run")
    with pytest.raises(KinemimicError, match="expected config or teachers, found both"):
        train("run", config=TrainConfig())


def test_the_budget_is_that_of_its_lessons() -> None:
    assert BUDGETS[OBSTACLE_POLISH] == lesson_samples(Joining())
