import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from peers.constant import constant

from kinemimic.evaluate.command import command
from kinemimic.evaluate.scoring import evaluate as stage
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import write_json, write_text
from kinemimic.retarget.formats.motion_json import motion_to_json, read_motion_json
from kinemimic.train.config.presets import PRESETS
from kinemimic.train.rollout.policy import Policy
from kinemimic.train.rollout.rollout import collect_trajectories
from kinemimic.train.rollout.trajectory import Trajectory
from kinemimic.train.sim.engines import resolve

OUTPUTS = {"scores.json", "curves.csv", "report.html", "trajectory.npz"}


def write_inputs(folder, motion):
    """A motion, and a policy for it that never corrects anything."""
    write_text(folder / "motion.json", motion_to_json(motion))
    idle = constant()
    record = {"samples": 0, "seconds": 0.0, "preset": "default", "seed": 0, "mirrored": True}
    record |= {"config": PRESETS["default"].to_json()}
    # As `train` does it: the identity of what was read back, rounded as the file is.
    made_from = {"inputs": {"motion": read_motion_json(folder / "motion.json").identity}}
    idle.save(folder / "policy.safetensors", record | {"provenance": made_from})


@pytest.fixture
def run(tmp_path, walk):
    """A run with a short non-cyclic motion and an idle policy."""
    write_inputs(tmp_path, replace(walk, cyclic=False))
    return tmp_path


def test_an_idle_policy_scores_what_no_policy_scores(run):
    scores = stage.evaluate(run, workers=1)
    assert scores["fit"] == scores["no_policy"]["fit"]
    assert scores["survival"] == scores["no_policy"]["survival"]
    assert scores["root"] == scores["no_policy"]["root"]
    assert scores["survival"]["of"] == 35
    assert scores["provenance"]["config"]["engine"] == resolve("auto")
    assert {path.name for path in run.iterdir()} >= OUTPUTS
    assert json.loads((run / "scores.json").read_text()) == scores
    assert str(run) not in (run / "scores.json").read_text() + (run / "report.html").read_text()


@pytest.fixture
def acted(run, walk, performance, monkeypatch):
    """The same with synthetic rollouts: a good fit with the policy, a fall without one."""

    def collect_trajectories(motion, policy, config, *, start_phases, frames, engine, workers, progress):
        for _ in start_phases:
            progress(1)
        played = performance(len(start_phases), frames, offset=0.05, fall=None if policy else 20)
        return replace(played, motion=motion.identity)

    write_inputs(run, walk)
    monkeypatch.setattr(stage, "collect_trajectories", collect_trajectories)
    # The report takes seconds and has its own tests.
    monkeypatch.setattr(stage, "report", lambda *_: "<!doctype html>")
    return run


def test_curves_csv_matches_the_trajectory(acted):
    scores = stage.evaluate(acted)
    rows = list(csv.DictReader((acted / "curves.csv").open()))
    assert len(rows) == 600
    gaps = [
        float(row["simulated_knee_left_deg"]) - float(row["reference_knee_left_deg"]) for row in rows[:500]
    ]
    assert np.sqrt(np.mean(np.square(gaps))) == pytest.approx(
        scores["fit"]["knee"]["left"]["rmse_deg"], abs=1e-3
    )
    assert float(rows[29]["time_s"]) == pytest.approx(1.0)
    assert rows[20]["no_policy_hip_right_deg"] == rows[599]["no_policy_hip_right_deg"]
    motion = read_motion_json(acted / "motion.json")
    assert len(Trajectory.load(acted / "trajectory.npz", motion).start_phases) == 13


def test_equal_inputs_give_equal_bytes(acted):
    first, second = (
        stage.evaluate(acted)
        and [(acted / name).read_bytes() for name in sorted(OUTPUTS - {"trajectory.npz"})]
        for _ in range(2)
    )
    assert first == second


def test_command_prints_a_table_or_json(acted):
    printed = CliRunner().invoke(command, ["--run", str(acted)], catch_exceptions=False).output
    assert "SIMULATED CAPTURE" in printed
    assert "medians over 13 start phases" in printed
    assert "600 of 600" in printed and "13 of 13" in printed
    assert f"report: {acted / 'report.html'}" in printed
    printed = CliRunner().invoke(command, ["--run", str(acted), "--json"], catch_exceptions=False).output
    assert json.loads(printed)["survival"]["phases"] == 13


def test_without_a_policy_nothing_is_written(run):
    (run / "policy.safetensors").unlink()
    with pytest.raises(KinemimicError, match="run `kinemimic train` first"):
        stage.evaluate(run)
    assert not OUTPUTS & {path.name for path in run.iterdir()}


def test_a_policy_of_another_motion_is_refused(run, walk):
    write_text(run / "motion.json", motion_to_json(walk))
    with pytest.raises(KinemimicError, match="expected a policy for this motion"):
        stage.evaluate(run)
    assert not OUTPUTS & {path.name for path in run.iterdir()}


def test_the_control_has_the_policys_task_and_rewards_are_by_the_final_scales(run, walk, monkeypatch):
    config = replace(PRESETS["default"], env=replace(PRESETS["default"].env, torque_feedforward=False))
    record = json.loads((run / "policy.json").read_text()) | {"config": config.to_json()}
    write_json(run / "policy.json", record)
    configs = []

    def collect(motion, policy, env, **options):
        configs.append((policy is None, env))
        return collect_trajectories(motion, policy, env, **options)

    monkeypatch.setattr(stage, "collect_trajectories", collect)
    monkeypatch.setattr(stage, "report", lambda *_: "<!doctype html>")
    scores = stage.evaluate(run, workers=1)
    assert [alone for alone, _ in configs] == [False, True]
    assert configs[0][1] == configs[1][1] == config.measured_env
    assert not configs[1][1].torque_feedforward
    assert scores["reward"]["scales"]["pose"] == 64.0 != config.env.reward.scales["pose"]
    # The rewards of the trajectory are those of the same states by the final scales, not by the first.
    actor, _ = Policy.load(run / "policy.safetensors")
    motion = read_motion_json(run / "motion.json")
    early = collect_trajectories(motion, actor, config.env, start_phases=np.zeros(1), frames=35, workers=1)
    late = Trajectory.load(run / "trajectory.npz", motion)
    np.testing.assert_array_equal(late.rotations, early.rotations)
    pose = list(late.reward_names).index("pose")
    weight, first = config.env.reward.weights["pose"], config.env.reward.scales["pose"]
    np.testing.assert_allclose(
        late.rewards[..., pose] / weight, (early.rewards[..., pose] / weight) ** (64.0 / first), atol=1e-9
    )
