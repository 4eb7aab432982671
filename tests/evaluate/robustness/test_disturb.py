"""Trials of scenarios: what is made of reward curves, and a crouching figure that is pulled and pelted."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from peers.constant import constant
from peers.crouch import crouching, write_idle_run

from kinemimic.evaluate.robustness import disturb as module
from kinemimic.evaluate.robustness.disturb import command, disturb
from kinemimic.evaluate.robustness.scenario_trials import (
    ScenarioTask,
    Trials,
    event_times,
    median_time,
    run_trials,
    summarize,
    trial_tasks,
)
from kinemimic.evaluate.view.scenario_replay import replay_scenario
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.scenario.scenario import Load, Placement, Range, Scenario
from kinemimic.train.scenario.scenario_file import find_scenario, shipped_scenarios
from kinemimic.train.sim.engines import resolve
from kinemimic.train.task.env import ACTIONS
from kinemimic.train.task.observation import OBSERVATIONS

SIDE = Range((0.0, -60.0, 0.0), (0.0, 60.0, 0.0))
PULL = Scenario("pull", seconds=1.5, loads=(Load("torso", Range.of(0.5), Range.of(0.3), force=SIDE),))
HARD = replace(PULL, name="hard", loads=(replace(PULL.loads[0], force=Range.of(900.0, 0.0, 0.0)),))
BALL = Placement(
    "sphere",
    Range.of(0.2, 0.2, 0.2),
    Range.of(1.0, 0.0, 0.8),
    mass=Range.of(2.0),
    velocity=Range.of(-3.0, 0.0, 1.0),
)
PELTED = Scenario("pelted", seconds=1.5, obstacles=(BALL,))


def made(rewards: list[list[float]], fallen_at: list[int]) -> Trials:
    found = np.array(rewards)
    return Trials(
        phases=np.zeros(len(found)),
        rewards=found,
        control=np.full(found.shape, 0.9),
        fallen_at=np.array(fallen_at),
        control_fell=np.zeros(len(found), dtype=bool),
    )


def test_dip_recovery_and_fall_are_those_of_the_curves() -> None:
    """Steps of 1/30 s, by hand: one recovers, one does not, one falls, one is never touched."""
    trials = made(
        [
            [0.9, 0.9, 0.5, 0.6, 0.86, 0.9],  # from step 2; at 4 it is within 0.05 again
            [0.9, 0.8, 0.7, 0.7, 0.7, 0.7],
            [0.9, 0.4, 0.3, 0.0, 0.0, 0.0],
            [0.9, 0.9, 0.9, 0.9, 0.9, 0.9],
        ],
        [6, 6, 3, 6],
    )
    found = summarize(trials)
    assert (found["trials"], found["survived"], found["affected"]) == (4, 0.75, 0.75)
    assert found["reward_drop"] == {"median": 0.4, "q25": 0.3, "q75": 0.65, "n": 3}
    assert found["recovered"] == 1
    assert found["recovery_s"]["median"] == pytest.approx(2 / 30, abs=1e-6)
    assert found["fall_s"] == {"median": 0.066667, "q25": 0.066667, "q75": 0.066667, "n": 1}
    assert found["onset_s"]["median"] == pytest.approx(1 / 30, abs=1e-6)
    assert found["curve"]["mean"][1] == pytest.approx((0.9 + 0.8 + 0.4 + 0.9) / 4)
    # Wilson's interval of 3 out of 4, from its formula.
    n, p, z = 4, 0.75, 1.959964
    middle, half = p + z * z / (2 * n), z * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    edges = [(middle - half) / (1 + z * z / n), (middle + half) / (1 + z * z / n)]
    assert found["survived_ci95"] == pytest.approx(edges, abs=1e-5)


def test_who_never_falls_counts_among_the_latest() -> None:
    """One that falls at once does not speak for four that never do; three do, by the middle one's time."""
    upright, down = [0.9, 0.5, 0.5, 0.5], [0.9, 0.5, 0.0, 0.0]
    rare = summarize(made([upright] * 4 + [down], [4] * 4 + [2]))
    assert rare["fall_s"]["median"] == pytest.approx(1 / 30, abs=1e-6)
    assert rare["typical_fall_s"] is None
    often = summarize(made([upright] * 2 + [down, down, [0.9, 0.5, 0.5, 0.0]], [4, 4, 2, 2, 3]))
    assert often["typical_fall_s"] == pytest.approx(2 / 30, abs=1e-6)
    assert often["typical_recovery_s"] is None


def test_a_difference_for_the_better_affects_a_trial_too() -> None:
    """A gain is an effect without a drop: it sets the onset, and has recovered at once."""
    found = summarize(made([[0.9, 0.95, 0.9, 0.9], [0.9, 0.9, 0.8, 0.9]], [4, 4]))
    assert found["affected"] == 1.0
    assert found["onset_s"]["q25"] < found["onset_s"]["q75"]
    when = event_times(made([[0.9, 0.95, 0.9, 0.9]], [4]))
    assert when.onset_s.tolist() == pytest.approx([1 / 30])
    assert when.recovery_s.tolist() == [0.0]


def test_the_median_of_an_even_number_is_the_later_of_the_middle_two() -> None:
    assert median_time(np.array([3.0, 1.0, 4.0, 2.0])) == 3.0
    assert median_time(np.array([1.0, np.inf])) == np.inf
    assert median_time(np.array([np.inf, 2.0, 1.0])) == 2.0
    assert median_time(np.array([])) == np.inf


def test_a_trial_whose_control_falls_tells_of_its_survival_only() -> None:
    trials = made([[0.9, 0.5, 0.5], [0.9, 0.1, 0.0]], [3, 2])
    found = summarize(replace(trials, control_fell=np.array([False, True])))
    assert (found["survived"], found["controls_fallen"], found["affected"]) == (0.5, 1, 0.5)
    assert found["reward_drop"]["median"] == pytest.approx(0.4)
    assert found["fall_s"]["n"] == 0


def test_what_never_touches_has_no_quartiles() -> None:
    found = summarize(made([[0.9, 0.9]], [2]))
    assert found["reward_drop"] == {"median": None, "q25": None, "q75": None, "n": 0}
    assert found["survived"] == 1.0


@pytest.fixture
def run(tmp_path: Path, walk: Motion) -> Path:
    write_idle_run(tmp_path, crouching(walk))
    return tmp_path


def test_a_strong_pull_fells_and_a_weak_one_does_not(run: Path) -> None:
    found = disturb(run, [PULL, HARD, PELTED], trials=12, workers=1)
    assert list(found) == ["pull", "hard", "pelted"]
    assert found["pull"]["survived"] == 1.0
    assert found["pull"]["onset_s"]["median"] == pytest.approx(0.5, abs=1e-6)
    assert found["hard"]["survived"] == 0.0
    assert 0.0 < found["hard"]["fall_s"]["median"] < 1.0
    assert found["pelted"]["affected"] == 1.0
    # A ball from a metre ahead at 3 m/s is there before it has come the whole metre.
    assert 0.1 < found["pelted"]["onset_s"]["median"] < 0.34
    for name in found:
        assert json.loads((run / f"scenario-{name}.json").read_text()) == found[name]
        assert found[name]["controls_fallen"] == 0


def test_a_scenario_twice_is_the_same_file(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Loads, and obstacles that are thrown: on any number of processes, in tasks of any number of trials."""

    def written(workers: int) -> list[bytes]:
        disturb(run, [PULL, PELTED], trials=7, workers=workers)
        return [(run / f"scenario-{name}.json").read_bytes() for name in ("pull", "pelted")]

    once = written(1)
    assert written(1) == once
    monkeypatch.setattr(module, "trial_tasks", partial(trial_tasks, per_task=3))
    assert written(2) == once


def test_a_trial_is_the_same_however_many_there_are_and_another_with_another_seed(run: Path) -> None:
    few, many, other = (
        disturb(run, [PULL], trials=trials, seed=seed, workers=1)["pull"]["per_trial"]
        for trials, seed in ((3, 0), (13, 0), (3, 1))
    )
    for key in ("phase", "fallen_at"):
        assert many[key][:3] == few[key]
    assert other["phase"] != few["phase"]


def test_engines_agree(run: Path, walk: Motion) -> None:
    """On who falls, and on the dip of a pull."""
    pytest.importorskip("kinemimic_native", reason="the native engine is not built here")
    found = {
        engine: disturb(run, [PULL, HARD], trials=6, workers=1, engine=engine)
        for engine in ("native", "pybullet")
    }
    for name in ("pull", "hard"):
        native, bullet = found["native"][name], found["pybullet"][name]
        assert native["survived"] == bullet["survived"]
        assert native["reward_drop"]["median"] == pytest.approx(bullet["reward_drop"]["median"], abs=0.02)


def seeing() -> Policy:
    """With a net, whose products would differ by their last digits with the size of the batch."""
    random = np.random.default_rng(0)
    hidden = random.normal(0.0, 0.1, (64, OBSERVATIONS)).astype(np.float32), np.zeros(64, np.float32)
    last = random.normal(0.0, 0.02, (ACTIONS, 64)).astype(np.float32), np.zeros(ACTIONS, np.float32)
    return Policy((hidden, last), np.zeros(OBSERVATIONS, np.float32), np.ones(OBSERVATIONS, np.float32))


@pytest.mark.parametrize("engine", ["native", "pybullet"])
@pytest.mark.parametrize("scenario", [PULL, PELTED], ids=lambda scenario: scenario.name)
def test_a_trial_alone_is_that_among_others_to_the_last_bit(
    engine: str, scenario: Scenario, walk: Motion
) -> None:
    if engine == "native":
        pytest.importorskip("kinemimic_native", reason="the native engine is not built here")
    task = ScenarioTask(
        crouching(walk), seeing(), PRESETS["default"].env, (scenario,), tuple(range(7)), 0, engine
    )
    among = run_trials(task)[0].rewards
    assert len(np.unique(among, axis=0)) == 7
    np.testing.assert_array_equal(run_trials(task)[0].rewards, among)
    for number in (0, 3, 6):
        (alone,) = run_trials(replace(task, numbers=(number,)))
        np.testing.assert_array_equal(alone.rewards[0], among[number])


def test_scenarios_tried_together_have_the_trials_and_controls_of_each_alone(walk: Motion) -> None:
    """Also if one is shorter, starts elsewhere, or steers the walk."""
    scenarios = (
        PULL,
        replace(PELTED, seconds=1.0),
        replace(HARD, phase=Range.of(0.25)),
        replace(PULL, route=((0.4, 0.5),)),
    )
    ahead = replace(crouching(walk), cycle_offset=np.array([0.5, 0.0, 0.0]))  # a route must lead somewhere
    task = ScenarioTask(ahead, seeing(), PRESETS["default"].env, scenarios, (0, 1), 0, resolve("auto"))
    together = run_trials(task)
    assert [found.rewards.shape for found in together] == [(2, 45), (2, 30), (2, 45), (2, 45)]
    assert not np.array_equal(together[0].control, together[2].control)
    assert not np.array_equal(together[0].control, together[3].control)
    for one, found in zip(scenarios, together, strict=True):
        (alone,) = run_trials(replace(task, scenarios=(one,)))
        for name, column in vars(alone).items():
            np.testing.assert_array_equal(vars(found)[name], column, err_msg=f"{one.name}, {name}")


def test_trials_read_back_from_json_are_equal(walk: Motion) -> None:
    task = ScenarioTask(
        crouching(walk), seeing(), PRESETS["default"].env, (HARD,), (0, 1), 0, resolve("auto")
    )
    (trials,) = run_trials(task)
    again = Trials.from_json(json.loads(json.dumps(trials.to_json())))
    for name, column in vars(trials).items():
        np.testing.assert_array_equal(vars(again)[name], column)
        assert vars(again)[name].dtype == column.dtype


def test_what_is_played_is_the_trial_of_that_number(walk: Motion) -> None:
    policy = seeing()
    task = ScenarioTask(crouching(walk), policy, PRESETS["default"].env, (PELTED,), (3,), 0, resolve("auto"))
    played, _ = replay_scenario(task.motion, policy, PRESETS["default"], PELTED, number=3)
    largest = sum(PRESETS["default"].final_reward.weights.values())
    measured = replace(task.config, reward=PRESETS["default"].final_reward)
    (alone,) = run_trials(replace(task, config=measured))[0].rewards
    stood = int(played.fallen_at[0])
    np.testing.assert_allclose(played.rewards[0, :stood].sum(axis=1) / largest, alone[:stood], atol=1e-12)


def test_scenarios_of_one_name_are_refused(run: Path) -> None:
    with pytest.raises(KinemimicError, match="expected scenarios of different names, found pull, pull"):
        disturb(run, [PULL, replace(HARD, name="pull")], trials=1)


def test_a_performance_that_ends_is_tried_to_its_end(walk: Motion) -> None:
    once = replace(crouching(walk), cyclic=False)
    task = ScenarioTask(once, constant(), PRESETS["default"].env, (PULL,), (0, 1), 0, resolve("auto"))
    (trials,) = run_trials(task)
    assert trials.rewards.shape == (2, int(once.duration * 30 + 1e-6))
    assert not trials.phases.any()


def test_command_lists_prints_and_refuses(run: Path) -> None:
    invoke = CliRunner().invoke
    listed = invoke(command, [], catch_exceptions=False).output
    for name in ("pull-forward", "several-obstacles"):
        assert name in listed
        assert find_scenario(name).about.split(":")[0][:30] in listed
    told = json.loads(invoke(command, ["--json"], catch_exceptions=False).output)
    assert list(told) == list(shipped_scenarios())
    assert told["pull-forward"] == find_scenario("pull-forward").about
    mine = run / "mine.toml"
    mine.write_text("seconds = 0.5\n[ground]\nfriction = 0.5\n", encoding="utf-8")
    options = ["--run", str(run), "--trials", "2"]
    printed = invoke(command, [str(mine), *options], catch_exceptions=False).output
    assert printed.splitlines()[1].split()[:2] == ["mine", "100.0"]
    printed = invoke(command, [str(mine), *options, "--json"], catch_exceptions=False).output
    assert json.loads(printed)["mine"] == json.loads((run / "scenario-mine.json").read_text())
    inside, place = run / "inside.toml", "position = [0.0, 0.0, 0.4]"
    inside.write_text(f'[[obstacle]]\nshape = "sphere"\nsize = 0.3\n{place}\n', encoding="utf-8")
    found = invoke(command, [str(inside), *options])
    assert isinstance(found.exception, KinemimicError)
    assert "scenario inside: expected obstacle 1 (sphere) apart from the humanoid" in str(found.exception)
    assert not (run / "scenario-inside.json").exists()
