"""A session: deterministic in its inputs, recorded and replayed to the last bit."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from kinemimic.evaluate.command import command
from kinemimic.evaluate.simulate.replay import replay_summary
from kinemimic.evaluate.simulate.session.frame import Frame, Score
from kinemimic.evaluate.simulate.session.inputs import (
    Carry,
    Clear,
    Drag,
    Enter,
    Ground,
    Input,
    Push,
    Release,
    Restart,
    Throw,
)
from kinemimic.evaluate.simulate.session.obstacles import MAX_OBSTACLES
from kinemimic.evaluate.simulate.session.recording import SESSION, Recorder, Replay, begin_session
from kinemimic.evaluate.simulate.session.session import LYING, Session
from kinemimic.evaluate.view.scenario_replay import replay_scenario
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.rotations import rotate
from kinemimic.retarget.humanoid.body import BODY_INDEX
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.policy import load_trained
from kinemimic.train.scenario.scenario_file import find_scenario

ENGINE = "pybullet"
# Every kind of input, by the control step before which it comes.
SCRIPT: dict[int, tuple[Input, ...]] = {
    10: (Push("torso", force=(60.0, 0.0, 0.0), steps=6),),
    20: (Drag("hand_left", (0.0, 0.0, 0.0), (2.0, 1.0, 1.2), limit=40.0),),
    26: (Release(), Carry("hand_left", 2.0)),
    30: (Throw("sphere", (0.24, 0.24, 0.24), 1.0, (1.8, 0.0, 1.1), (-2.0, 0.0, 2.6)),),
    36: (Clear(), Ground(0.5, 0.02)),
    44: (Clear(), Restart(0.3)),
    60: (Enter("thrown-ball", 3),),
    75: (Enter(),),
    80: (Push("torso", force=(0.0, 1500.0, 0.0), steps=20),),
}
STEPS = 175


def opened(run: Path, *, restart: bool = True) -> Session:
    return begin_session(run, ENGINE, restart=restart, named=find_scenario)


def played(session: Session, script: dict[int, tuple[Input, ...]], recorder: Recorder | None) -> list[Frame]:
    frames = []
    for step in range(STEPS):
        for one in script.get(step, ()):
            session.apply(one)
            if recorder is not None:
                recorder.input(step, one)
        frames.append(session.advance())
        if recorder is not None:
            recorder.advanced(session)
    return frames


@pytest.fixture(scope="module")
def recorded(walk_run: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Frame], str]:
    """A folder with a recorded session, its frames, and its score."""
    folder = tmp_path_factory.mktemp("recordings") / "session-1"
    session = opened(walk_run)
    recorder = Recorder(folder, walk_run, ENGINE, restart=True, speed=1.0)
    frames = played(session, SCRIPT, recorder)
    score = str(session.score())
    recorder.close(session)
    session.close()
    return folder, frames, score


def test_a_replay_has_the_same_bits_and_the_same_score(recorded: tuple[Path, list[Frame], str]) -> None:
    folder, frames, score = recorded
    again = Replay(folder, named=find_scenario)
    for one, other in zip(again, frames, strict=True):
        np.testing.assert_array_equal(one.bodies.positions, other.bodies.positions)
        np.testing.assert_array_equal(one.rotations, other.rotations)
        np.testing.assert_array_equal(one.states, other.states)
        assert one.fallen == other.fallen
    assert str(again.score) == score


def test_every_input_shows(recorded: tuple[Path, list[Frame], str]) -> None:
    _, frames, _ = recorded
    assert frames[12].loads[:, 0].max() == pytest.approx(60.0, abs=1.0)
    assert frames[22].drag is not None
    assert frames[28].drag is None
    assert frames[28].loads[:, 2].min() == pytest.approx(-2.0 * 9.81)
    # A slope is no load, but gravity that is tilted; a restart keeps it, a scenario does without.
    assert np.linalg.norm(frames[40].tilt) == pytest.approx(2.0 * 9.81 * np.sin(0.5 * 0.02))
    loads = np.linalg.norm(frames[40].loads, axis=-1)
    assert np.flatnonzero(loads > 1e-9).tolist() == [BODY_INDEX["hand_left"]]
    assert [frames[k].tilt.any() for k in (30, 40, 50, 60, 74, 75)] == [False, True, True, False, False, True]
    assert [len(frames[k].obstacles) for k in (29, 30, 35, 36)] == [0, 1, 1, 0]
    assert frames[44].phase < frames[43].phase
    # The scenario throws its ball after a second, and it was left before.
    assert not frames[74].obstacles
    assert any(frame.fallen for frame in frames[80:])


def test_a_fallen_humanoid_gets_up_after_two_seconds_unless_told_not_to(walk_run: Path) -> None:
    script: dict[int, tuple[Input, ...]] = {0: (Push("torso", force=(0.0, 2000.0, 0.0), steps=20),)}
    fell = [frame.fallen for frame in played(opened(walk_run), script, None)]
    first = fell.index(True)
    assert all(fell[first : first + LYING])
    assert not fell[first + LYING]
    assert all([frame.fallen for frame in played(opened(walk_run, restart=False), script, None)][first:])


def test_a_walk_scores_like_its_evaluation(walk_run: Path) -> None:
    session = opened(walk_run)
    assert session.score() is None
    played(session, {}, None)
    score = session.score()
    assert score is not None
    assert score.frames == score.upright == STEPS
    assert min(score.knee, score.hip) > 0.98
    assert score.speed == pytest.approx(1.0, abs=0.05)


def test_a_scenario_keeps_its_own_obstacles_and_ground(walk_run: Path) -> None:
    session = opened(walk_run)
    session.apply(Enter("thrown-ball", 0))
    box = Throw("box", (0.3, 0.3, 0.3), 1.0, (1.5, 0.0, 0.15))
    for one in (box, Ground(0.2)):
        with pytest.raises(KinemimicError, match="leave it first"):
            session.apply(one)
    with pytest.raises(KinemimicError, match="expected a shipped scenario"):
        session.apply(Enter("no-such", 0))
    session.advance()


def test_a_scenario_is_the_trial_of_its_number_whatever_ground_a_person_set(walk_run: Path) -> None:
    motion, policy, record = load_trained(walk_run)
    config = TrainConfig.from_json(record["config"])
    room = replace(find_scenario("room"), seconds=1.0)
    played_there, shown = replay_scenario(motion, policy, config, room, number=3, engine=ENGINE)
    session = opened(walk_run)
    session.apply(Ground(0.1, 0.1))
    session.apply(Enter("room", 3))
    frames = [session.advance() for _ in range(len(played_there.root[0]))]
    assert len(frames[-1].obstacles) == len(shown.obstacles) > 0
    assert frames[-1].obstacles == tuple(shown.obstacles)
    np.testing.assert_array_equal([frame.bodies.positions[0] for frame in frames], played_there.root[0])
    assert not frames[-1].tilt.any()
    session.apply(Enter())
    assert session.advance().tilt.any()


def test_a_trial_without_a_place_for_its_obstacles_changes_nothing(
    walk_run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = opened(walk_run)
    session.apply(Enter("several-obstacles", 0))
    session.advance()
    before, step = session.digest(), session.look()

    def full(*_: object) -> None:
        raise KinemimicError("found it in the torso")

    monkeypatch.setattr("kinemimic.evaluate.simulate.session.session.draw_event_schedule", full)
    for event in (Restart(0.5), Enter("room", 1)):
        with pytest.raises(KinemimicError, match="in the torso"):
            session.apply(event)
        assert session.digest() == before
        assert session.look().numbers == step.numbers
    session.advance()


def test_a_slope_and_obstacles_that_can_move_exclude_each_other(walk_run: Path) -> None:
    session = opened(walk_run)
    ball = Throw("sphere", (0.24,) * 3, 1.0, (1.8, 0.0, 1.1))
    wall = Throw("box", (0.1, 1.0, 1.0), 0.0, (5.0, 0.0, 0.5))
    session.apply(Ground(0.9, 0.05))
    session.apply(wall)
    with pytest.raises(KinemimicError, match="set the slope to 0 first"):
        session.apply(ball)
    session.apply(Ground(0.9))
    session.apply(ball)
    with pytest.raises(KinemimicError, match="remove the obstacles first"):
        session.apply(Ground(0.9, 0.05))
    session.apply(Clear())
    session.apply(Ground(0.9, 0.05))
    assert session.advance().tilt.any()


def test_a_slope_keeps_its_direction_when_the_humanoid_turns(walk_run: Path) -> None:
    session = opened(walk_run)
    session.apply(Ground(0.9, 0.05))
    session.apply(Push("pelvis", torque=(0.0, 0.0, 300.0), steps=10))
    frames = [session.advance() for _ in range(15)]
    yaws = [float(rotate(frame.bodies.rotations[0], np.array([1.0, 0.0, 0.0]))[1]) for frame in frames]
    assert np.ptp(yaws) > 0.2
    np.testing.assert_array_equal([frame.tilt for frame in frames], [frames[0].tilt] * 15)


def test_obstacles_have_numbers_of_their_own(walk_run: Path) -> None:
    session = opened(walk_run)
    ball = Throw("sphere", (0.24,) * 3, 1.0, (3.0, 0.0, 1.1))
    numbers = [session.look().numbers]
    for event in (ball, ball, Clear(), ball, Restart(), ball):
        session.apply(event)
        numbers.append(session.look().numbers)
    assert numbers == [(), (0,), (0, 1), (), (2,), (), (3,)]
    for k in range(MAX_OBSTACLES):
        session.apply(Throw("sphere", (0.1,) * 3, 1.0, (3.0 + k, 3.0, 0.1)))
    assert session.look().numbers == tuple(range(4, 4 + MAX_OBSTACLES))


def test_a_look_shows_what_inputs_changed_without_a_control_step(walk_run: Path) -> None:
    session = opened(walk_run)
    session.apply(Push("torso", force=(50.0, 0.0, 0.0), steps=60))
    frame = session.advance()
    seen = session.look()
    assert (seen.step, seen.fallen) == (frame.step, frame.fallen)
    np.testing.assert_array_equal(seen.loads, frame.loads)
    session.apply(Restart(0.5))
    session.apply(Throw("sphere", (0.24,) * 3, 1.0, (1.8, 0.0, 1.1)))
    session.apply(Drag("head", (0.0, 0.0, 0.0), (1.0, 0.0, 2.0)))
    seen = session.look()
    assert (seen.step, seen.phase, len(seen.obstacles)) == (1, 0.5, 1)
    assert seen.dragged == BODY_INDEX["head"]
    assert seen.drag is not None
    assert not seen.loads.any()
    assert session.step_count == 1


def test_the_score_counts_the_time_on_the_ground_also_after_a_restart(walk_run: Path) -> None:
    session = opened(walk_run)
    script: dict[int, tuple[Input, ...]] = {0: (Push("torso", force=(0.0, 2000.0, 0.0), steps=20),)}
    frames = played(session, script, None)
    score = session.score()
    assert score is not None
    assert not frames[-1].fallen
    assert (score.frames, score.upright) == (STEPS, sum(not frame.fallen for frame in frames))
    session.apply(Restart())
    assert session.score() is None


def test_clear_ends_pushes_also_in_a_scenario_and_replays(walk_run: Path, tmp_path: Path) -> None:
    folder, session = tmp_path / "session-1", opened(walk_run)
    recorder = Recorder(folder, walk_run, ENGINE, restart=True)
    script: dict[int, tuple[Input, ...]] = {
        0: (Enter("several-obstacles", 0), Push("torso", force=(20.0, 0.0, 0.0), steps=200)),
        20: (Clear(),),
    }
    frames = played(session, script, recorder)
    recorder.close(session)
    assert frames[19].loads.any()
    assert not frames[20].loads.any()
    assert len(frames[20].obstacles) == len(frames[19].obstacles) > 0
    assert len(list(Replay(folder, named=find_scenario))) == STEPS


def test_a_score_without_a_speed_is_recorded(recorded: tuple[Path, list[Frame], str], tmp_path: Path) -> None:
    score = Score(30, 30, 0.9, 0.8, float("nan"))
    assert score.to_json()["speed"] is None
    assert str(Score.from_json(score.to_json())) == str(score)
    # As version 0.4 wrote it: the line is read, and its score compared.
    folder = tmp_path / "older"
    shutil.copytree(recorded[0], folder)
    text = (folder / SESSION).read_text()
    (folder / SESSION).write_text(re.sub(r'"speed":[-.\de]+}}', '"speed":NaN}}', text))
    assert "NaN" in (folder / SESSION).read_text()
    with pytest.raises(KinemimicError, match='"speed": null}, found'):
        list(Replay(folder, named=find_scenario))


def test_a_killed_recording_replays_up_to_its_last_whole_line(
    recorded: tuple[Path, list[Frame], str], tmp_path: Path
) -> None:
    shutil.copytree(recorded[0], tmp_path / "killed")
    path = tmp_path / "killed" / SESSION
    path.write_bytes(path.read_bytes()[: -len(path.read_bytes()) // 3])
    assert 0 < len(list(Replay(tmp_path / "killed", named=find_scenario))) < STEPS


@pytest.mark.parametrize(
    ("line", "text", "message"),
    [
        (1, '{"schema": 99, "engine": "pybullet"}', "schema 2, found 99"),
        (1, "no json", "line 1: expected a line of a recorded session"),
        (2, '{"step": 10, "input": {"type": "push", "body": "tail"}}', "line 2: expected a body"),
        (2, '{"step": 10, "digest": "0000"}', "line 2: expected the recorded state after control step 10"),
        (3, '{"step": 1}', "line 3: expected steps in order, found 1 after"),
        (
            3,
            '{"step": 1000000000000}',
            "line 3: expected a line every 30 control steps, .* found step 1,",
        ),
        (1, '{"schema": 2, "engine": "pybullet", "speed": 1e-9}', "line 1: .*`float` >= 0.1"),
        (-1, f'{{"step": {STEPS}, "score": {{"knee": 1}}}}', 'the score that was shown, {"knee": 1}, '),
    ],
)
def test_a_damaged_recording_is_one_line(
    recorded: tuple[Path, list[Frame], str], tmp_path: Path, line: int, text: str, message: str
) -> None:
    folder = tmp_path / "damaged"
    shutil.copytree(recorded[0], folder)
    lines = (folder / SESSION).read_text().splitlines()
    lines[line - 1 if line > 0 else line] = text
    (folder / SESSION).write_text("\n".join(lines) + "\n")
    with pytest.raises(KinemimicError, match=message):
        list(Replay(folder, named=find_scenario))


def test_the_command_replays_and_writes_a_recording(recorded: tuple[Path, list[Frame], str]) -> None:
    folder, _, score = recorded
    done = CliRunner().invoke(command, ["--run", str(folder)])
    assert done.exit_code == 0, done.output
    assert score in done.output
    assert (folder / "session.rrd").stat().st_size > 10_000
    done = CliRunner().invoke(command, ["--run", str(folder), "--json"])
    assert json.loads(done.stdout)["steps"] == STEPS


def test_a_session_that_followed_nobody_says_so_and_no_number_is_nan() -> None:
    score = Score(frames=30, upright=30, knee=1.0, hip=1.0, speed=float("nan"))
    assert "speed undefined" in str(score)

    def line(people: int) -> str:
        found = {"steps": 30, "people": people, "score": score.to_json()}
        return replay_summary(Path("session"), found).splitlines()[1]

    assert line(0) == "nobody was followed"
    assert line(1) == str(score)
