"""Humanoids beside a session's: they move as alone, and take the same pushes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from kinemimic.evaluate.simulate.session.companions import APART, BEHIND
from kinemimic.evaluate.simulate.session.frame import Companions, Frame
from kinemimic.evaluate.simulate.session.inputs import (
    Carry,
    Clear,
    Drag,
    Enter,
    Ground,
    Input,
    Push,
    Restart,
    Throw,
)
from kinemimic.evaluate.simulate.session.recording import begin_session
from kinemimic.evaluate.simulate.session.session import LYING, Session
from kinemimic.train.scenario.scenario_file import find_scenario

ENGINE = "pybullet"
OTHERS = 3
HARD = Push("torso", force=(0.0, 1500.0, 0.0), steps=20)


def opened(run: Path, companions: int = OTHERS) -> Session:
    return begin_session(run, ENGINE, companions=companions, named=find_scenario)


def companions(frame: Frame) -> Companions:
    assert frame.companions is not None
    return frame.companions


def test_the_humanoid_of_the_session_moves_as_without_companions(walk_run: Path) -> None:
    script: dict[int, Input] = {
        5: Push("torso", force=(60.0, 0.0, 0.0), steps=6),
        10: Drag("hand_left", (0.0, 0.0, 0.0), (2.0, 1.0, 1.2), limit=40.0),
        15: Ground(0.5, 0.02),
        20: Restart(0.4),
        25: Enter("thrown-ball", 1),
        30: Enter(),
        35: HARD,
    }
    alone, accompanied = opened(walk_run, 0), opened(walk_run)
    for step in range(60):
        for session in (alone, accompanied):
            if step in script:
                session.apply(script[step])
            session.advance()
        assert accompanied.digest() == alone.digest()
    alone.close()
    accompanied.close()


@pytest.mark.parametrize(
    "event",
    [
        Push("torso", force=(30.0, 20.0, 0.0), steps=6),
        Carry("hand_left", 4.0),
        Ground(0.3, 0.0),
        Ground(0.9, 0.05),
    ],
)
def test_a_companion_moves_as_a_humanoid_alone_from_its_phase(walk_run: Path, event: Input) -> None:
    group, alone = opened(walk_run), opened(walk_run, 0)
    alone.apply(Restart(2 / (OTHERS + 1)))
    found, wanted = [], []
    for step in range(30):
        if step == 3:
            group.apply(event)
            alone.apply(event)
        found.append(companions(group.advance()).positions[1])
        wanted.append(alone.advance().bodies.positions)
    moved = np.array(wanted) - np.array(found)
    # Somewhere else in the world, and there for the whole time.
    np.testing.assert_allclose(moved, np.broadcast_to(moved[0, 0], moved.shape), atol=1e-4)
    assert abs(moved[0, 0, 2]) < 1e-6
    assert np.hypot(*moved[0, 0, :2]) > APART
    group.close()
    alone.close()


def test_they_walk_in_rows_from_phases_that_are_evenly_spread(walk_run: Path) -> None:
    session = opened(walk_run, 5)
    frame = session.advance()
    others = companions(frame).positions[:, 0] - frame.bodies.positions[0]
    np.testing.assert_allclose(others[:4, 1], APART * np.arange(1, 5), atol=0.1)
    np.testing.assert_allclose(others[:4, 0], 0.0, atol=0.1)
    np.testing.assert_allclose(others[4, :2], [-BEHIND, 0.0], atol=0.1)
    poses = [frame.bodies.positions, *companions(frame).positions]
    hips = [pose - pose[0] for pose in poses]
    distances = [np.abs(a - b).max() for k, a in enumerate(hips) for b in hips[:k]]
    assert min(distances) > 0.05
    session.close()


def test_who_falls_is_counted_until_the_next_push_and_comes_back_to_its_place(walk_run: Path) -> None:
    session = opened(walk_run)
    for _ in range(10):
        session.advance()
    session.apply(HARD)
    for _ in range(60):
        frame = session.advance()
    assert frame.fallen
    assert companions(frame).fallen.all()
    assert session.words()[-1].startswith("0 of 4 ")
    for _ in range(LYING):
        frame = session.advance()
    assert not companions(frame).fallen.any()
    places = companions(frame).positions[:, 0] - frame.bodies.positions[0]
    assert np.hypot(places[:, 0], places[:, 1]).max() < 4.0 * APART
    assert session.words()[-1].startswith("0 of 4 ")
    session.apply(Clear())
    assert session.words()[-1].startswith("4 of 4 ")
    session.close()


def test_a_restart_keeps_the_places(walk_run: Path) -> None:
    session = opened(walk_run)
    before = session.advance()
    for _ in range(70):  # more than a cycle
        session.advance()
    session.apply(Restart(0.0))
    after = session.advance()
    np.testing.assert_allclose(companions(after).positions, companions(before).positions, atol=1e-5)
    session.close()


def test_in_a_scenario_the_humanoid_is_alone(walk_run: Path) -> None:
    session = opened(walk_run)
    session.apply(Enter("thrown-ball", 1))
    assert session.advance().companions is None
    assert not any("humanoids" in line for line in session.words())
    session.apply(Enter())
    assert companions(session.advance()).positions.shape == (OTHERS, 15, 3)
    session.close()


def test_an_obstacle_is_of_the_session_alone(walk_run: Path) -> None:
    thrown = Throw("sphere", (0.24,) * 3, 5.0, (1.0, 0.0, 1.1), (-6.0, 0.0, 0.0))
    hit, free = opened(walk_run), opened(walk_run)
    hit.apply(thrown)
    for _ in range(20):
        one, other = hit.advance(), free.advance()
    assert np.abs(one.bodies.positions - other.bodies.positions).max() > 0.05
    np.testing.assert_array_equal(companions(one).positions, companions(other).positions)
    hit.close()
    free.close()
