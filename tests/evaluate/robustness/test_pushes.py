"""Pushes: which force acts when and where to, what is made of who survives it, and a figure that topples."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from peers.constant import constant
from peers.crouch import crouching, write_idle_run
from peers.elsewhere import turned

from kinemimic.evaluate.robustness import push_trials
from kinemimic.evaluate.robustness import pushes as module
from kinemimic.evaluate.robustness.push_trials import (
    DIRECTIONS,
    EXTENDED_GRID,
    GRID,
    RESOLUTION,
    PushTask,
    SearchResult,
    push_from_all_directions,
    push_phases,
    search,
)
from kinemimic.evaluate.robustness.pushes import force_survived_by, pushes, summary
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import write_text
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.humanoid.body import BODY_INDEX
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.env_config import EnvConfig
from kinemimic.train.recovery.pushes import PUSH, SETTLE, SURVIVE
from kinemimic.train.reference.reference import Reference
from kinemimic.train.sim.engines import resolve
from kinemimic.train.task.env import ACTIONS
from kinemimic.train.task.observation import OBSERVATIONS

IDLE = constant()


def judged(survives: Callable[[float], bool]) -> tuple[SearchResult, list[float]]:
    """What a search finds if `survives` judges, and the forces that it tried."""
    one, tried = search(), []
    force = next(one)
    while True:
        tried.append(force)
        try:
            force = one.send(survives(force))
        except StopIteration as done:
            return done.value, tried


@pytest.mark.parametrize("threshold", [1.0, 39.0, 40.0, 107.3, 299.0, 300.0, 417.0])
def test_a_search_finds_the_border(threshold: float) -> None:
    found, tried = judged(lambda force: force <= threshold)
    assert found.survived_unpushed
    assert threshold - RESOLUTION < found.threshold <= threshold
    assert found.grid == tuple(force <= threshold for force in GRID)
    assert len(tried) <= 1 + len(GRID) + len(EXTENDED_GRID) + 6


def test_what_nothing_fells_has_the_largest_force_for_its_border() -> None:
    found, tried = judged(lambda force: True)
    assert found == SearchResult(600.0, True, (True,) * len(GRID))
    assert tried == [0.0, *GRID, *EXTENDED_GRID]


def test_the_border_is_the_lowest_of_several() -> None:
    """It falls from 70 N on, and stands 120 to 260 N again: plain bisection of 0 to 600 N would say 260."""
    found, _ = judged(lambda force: force < 70 or 120 < force < 260)
    assert 70 - RESOLUTION <= found.threshold < 70
    assert found.grid == (True, True, False, False, True, True, True, True, False)


def test_who_falls_unpushed_survives_nothing() -> None:
    found, tried = judged(lambda force: False)
    assert found == SearchResult(0.0, False, (False,) * len(GRID))
    assert tried == [0.0]


def test_survived_is_the_largest_force_within_the_border_of_enough_phases() -> None:
    twenty = [10.0 * k for k in (3, 20, 1, 2, *range(4, 20))]  # 10 to 200, in no order
    assert force_survived_by(twenty, 50) == 110.0  # 110 to 200: ten phases
    assert force_survived_by(twenty, 90) == 30.0  # 30 to 200: eighteen
    assert force_survived_by([50.0, 10.0, 30.0], 50) == 30.0  # two of three
    assert force_survived_by([50.0, 10.0, 30.0], 90) == 10.0  # all
    assert force_survived_by([7.0], 50) == force_survived_by([7.0], 90) == 7.0


def test_the_summary_keeps_directions_apart() -> None:
    first = [
        SearchResult(threshold, True, (threshold >= 100,) * len(GRID))
        for threshold in (100.0, 50.0, 70.0, 80.0)
    ]
    second = [
        SearchResult(threshold, True, (threshold >= 100,) * len(GRID))
        for threshold in (300.0, 60.0, 90.0, 70.0)
    ]
    second[1] = SearchResult(0.0, False, (False,) * len(GRID))
    result = summary([first, second])
    assert result["directions"]["forward"]["thresholds_n"] == [100.0, 300.0]
    assert result["directions"]["forward"]["survived_n"] == {"50": 300.0, "90": 100.0}
    assert result["directions"]["forward"]["grid"] == [1.0] * len(GRID)
    assert result["directions"]["backward"]["thresholds_n"] == [50.0, 0.0]
    assert result["directions"]["left"]["thresholds_n"] == [70.0, 90.0]
    assert result["directions"]["right"]["grid"] == [0.0] * len(GRID)
    assert result["weakest_n"] == {"50": 50.0, "90": 0.0}
    assert result["survived_unpushed"] == 7 / 8


def test_pushes_come_all_around_a_cycle_or_within_a_performance(walk: Motion) -> None:
    np.testing.assert_allclose(push_phases(walk, 4), [0, 0.25, 0.5, 0.75])
    frames = 301  # of 30 Hz: 10 s; 1 s before the first push, 5.2 s from the last one on
    long = replace(
        walk, cyclic=False, root=np.zeros((frames, 3)), rotations=np.tile(walk.rotations[:1], (frames, 1, 1)),
        contacts=np.zeros((frames, 2), dtype=bool),
    )  # fmt: skip
    np.testing.assert_allclose(push_phases(long, 3) * long.duration, [1.0, 2.9, 4.8])
    with pytest.raises(KinemimicError, match=r"at least 6\.2 s .* found a motion of 1\.2 s"):
        push_phases(replace(walk, cyclic=False), 3)


class Judge:
    """A batch without physics, whose figures fall when their push ends if its impulse was too large.

    borders: N that a push along x, -x, y, -y of the world may have.
    trials: per figure, every trial's wrenches (steps, 15, 6).
    """

    borders = (100.0, 70.0, 260.0, 20.0)

    def __init__(self, world: Any, reference: Reference, config: EnvConfig) -> None:
        self.trials: list[list[list[np.ndarray]]] = [[] for _ in range(4)]
        self.starts: list[float] = []
        self.world, self.ages = world, np.zeros(4, dtype=np.int64)
        Judge.last = self

    last: Judge

    def reset(self, indices: np.ndarray, phases: np.ndarray) -> None:
        self.starts += phases.tolist()
        self.ages[indices] = 0
        for k in indices:
            self.trials[k].append([])

    def observe(self) -> np.ndarray:
        return np.zeros((4, OBSERVATIONS))

    def step(self, actions: np.ndarray, wrenches: np.ndarray) -> SimpleNamespace:
        assert actions.shape == (4, ACTIONS)
        for trial, wrench in zip(self.trials, wrenches, strict=True):
            trial[-1].append(wrench.copy())
        self.ages += 1
        return SimpleNamespace(observations=self.observe())

    def fallen(self) -> np.ndarray:
        fell = []
        for trial in self.trials:
            x, y = np.sum([wrench[0, :2] for wrench in trial[-1]], axis=0) / 6
            along = int(np.argmax([x, -x, y, -y]))
            too_hard = math.hypot(x, y) > self.borders[along] + 1e-6
            fell.append(too_hard and len(trial[-1]) >= SETTLE + PUSH)
        return np.array(fell)


@pytest.fixture
def judge(monkeypatch: pytest.MonkeyPatch) -> type[Judge]:
    monkeypatch.setattr(push_trials, "ImitationBatch", Judge)
    monkeypatch.setattr(push_trials, "open_world", lambda *_: SimpleNamespace(size=4, close=lambda: None))
    return Judge


def task(motion: Motion, phase: float = 0.25) -> PushTask:
    return PushTask(motion, IDLE, EnvConfig(), phase, "auto")


def test_a_push_is_six_control_steps_on_the_pelvis_one_second_after_the_start(
    walk: Motion, judge: type[Judge]
) -> None:
    push_from_all_directions(task(walk))
    assert (SETTLE, PUSH, SURVIVE) == (30, 6, 150)
    assert set(judge.last.starts) == {0.25 - 1.0 / 1.2}  # a second before, of a cycle of 1.2 s
    # Forward, the second trial is the grid's first force, and survived to the end.
    trial = np.array(judge.last.trials[0][1])
    assert len(trial) == SETTLE + PUSH + SURVIVE
    expected = np.zeros_like(trial)
    expected[30:36, BODY_INDEX["pelvis"], 0] = GRID[0]
    np.testing.assert_allclose(trial, expected, atol=1e-9)
    # 125 N fell the figure, so that the trial of 150 N begins with the step after the push's last.
    assert [len(one) for one in judge.last.trials[0][4:7]] == [186, 36, 36]


def test_directions_are_the_references(walk: Motion, judge: type[Judge]) -> None:
    """The figure that walks along y is pushed forward along y, and to the left along -x."""
    along_x = [one.threshold for one in push_from_all_directions(task(walk))]
    for found, threshold in zip(along_x, (100.0, 70.0, 260.0, 20.0), strict=True):
        assert threshold - RESOLUTION < found <= threshold
    along_y = [one.threshold for one in push_from_all_directions(task(turned(walk, 0.5 * math.pi)))]
    x, x_back, y, y_back = along_x
    assert along_y == [y, y_back, x_back, x]
    assert list(DIRECTIONS) == ["forward", "backward", "left", "right"]


@pytest.fixture
def crouch(walk: Motion) -> Motion:
    return crouching(walk)


def test_a_figure_with_two_equal_sides_topples_to_both_alike(
    crouch: Motion, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Fewer trials than in earnest.
    monkeypatch.setattr(push_trials, "GRID", (200.0,))
    monkeypatch.setattr(push_trials, "EXTENDED_GRID", (1000.0,))
    monkeypatch.setattr(push_trials, "RESOLUTION", 50.0)
    found = push_from_all_directions(task(crouch))
    assert all(one.survived_unpushed for one in found)
    _, _, left, right = found
    assert 0.0 < left.threshold < 1000.0
    assert abs(left.threshold - right.threshold) <= 50.0


@pytest.fixture
def run(tmp_path: Path, walk: Motion) -> Path:
    write_idle_run(tmp_path, walk)
    return tmp_path


def test_without_a_policy_of_any_skill_a_walk_survives_nothing(run: Path) -> None:
    result = pushes(run, phases=2)
    assert result["survived_unpushed"] == 0.0
    assert result["weakest_n"] == {"50": 0.0, "90": 0.0}
    assert all(one["thresholds_n"] == [0.0, 0.0] for one in result["directions"].values())
    text = (run / "pushes.json").read_text()
    assert json.loads(text) == result
    assert str(run) not in text
    assert result["provenance"]["config"]["engine"] == resolve("auto")
    assert result["provenance"]["seed"] == 3


@pytest.mark.slow
def test_the_same_pushes_whatever_the_number_of_processes(tmp_path: Path, crouch: Motion) -> None:
    write_idle_run(tmp_path, crouch)
    written = []
    for workers in (1, 2):
        result = pushes(tmp_path, phases=2, workers=workers)
        written.append((tmp_path / "pushes.json").read_bytes())
    assert written[0] == written[1]
    assert result["survived_unpushed"] == 1.0
    assert all(min(one["thresholds_n"]) > 0.0 for one in result["directions"].values())


@pytest.fixture
def found(run: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A run whose figures have made-up borders: 30, 40 … 220 N, and 600 N to the right."""

    def in_this_process(work: object, tasks: list[PushTask], **_: object) -> list[list[SearchResult]]:
        borders = [30.0 + 10.0 * k for k in range(len(tasks))]
        return [
            [SearchResult(threshold, True, tuple(threshold >= force for force in GRID))] * 3
            + [SearchResult(600.0, True, (True,) * len(GRID))]
            for threshold in borders
        ]

    monkeypatch.setattr(module, "parallel_map", in_this_process)
    return run


def test_command_prints_a_table_or_json(found: Path) -> None:
    printed = CliRunner().invoke(module.command, ["--run", str(found)], catch_exceptions=False).output
    rows = {line.split()[0]: line.split()[1:] for line in printed.splitlines() if line.strip()}
    assert "of 20 phases" in printed
    assert "stand" not in printed
    assert rows["forward"][:5] == ["130", "50", "95", "85", "75"]  # 50 %, 90 %; at 40, 60, 80 N
    assert rows["right"][:3] == ["≥600", "≥600", "100"]
    printed = (
        CliRunner().invoke(module.command, ["--run", str(found), "--json"], catch_exceptions=False).output
    )
    assert json.loads(printed) == json.loads((found / "pushes.json").read_text())


def test_what_does_not_fit_is_refused_and_nothing_written(run: Path, walk: Motion) -> None:
    write_text(run / "motion.json", motion_to_json(turned(walk, 1.0)))
    with pytest.raises(KinemimicError, match="expected a policy for this motion"):
        pushes(run)
    (run / "policy.safetensors").unlink()
    with pytest.raises(KinemimicError, match="run `kinemimic train` first"):
        pushes(run)
    (run / "motion.json").unlink()
    with pytest.raises(KinemimicError, match="motion"):
        pushes(run)
    assert not (run / "pushes.json").exists()
