"""A session behind a live capture: what it tells, how far it is behind, where it puts the humanoid."""

from __future__ import annotations

from collections import deque
from importlib.util import find_spec
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from samples.walker import walker

from kinemimic.evaluate.simulate.frame import LiveSettings
from kinemimic.evaluate.simulate.inputs import Restart
from kinemimic.evaluate.simulate.live_session import PREVIEW, LiveSession
from kinemimic.evaluate.simulate.recording import begin_live_session
from kinemimic.pipeline.live.capture import Moment
from kinemimic.pipeline.live.frame import frame_of
from kinemimic.train.reference.live_reference import AHEAD
from kinemimic.train.rollout.tracker_file import tracker_path
from kinemimic.train.scenario.scenario_file import scenario
from kinemimic.train.sim.world import CONTROL_RATE

LAG = 0.15
STEP = 1.0 / CONTROL_RATE


def moment(time: float) -> Moment:
    return Moment(time, np.zeros((1, 20, 3)), 0, LAG, np.zeros((20, 3)))


def latencies(times: list[float | None], senders: list[int] | None = None) -> list[float]:
    """Latencies of a session whose moments are at these times."""
    session: Any = SimpleNamespace(
        _moments=deque([None] * AHEAD, maxlen=AHEAD), _senders=0, capture=SimpleNamespace(senders=1)
    )
    found = []
    for k, time in enumerate(times):
        session.capture.senders = 1 if senders is None else senders[k]
        found.append(LiveSession._latency(session, None if time is None else moment(time)))
    return found


def test_the_latency_is_that_of_the_moment_which_is_performed() -> None:
    steady: list[float | None] = [STEP * k for k in range(40)]
    assert latencies(steady) == pytest.approx([LAG + PREVIEW] * 40)
    # After a skip by a second, what is performed is older until the skip is performed.
    skipped = [*steady, *(STEP * k + 1.0 for k in range(40, 60))]
    found = latencies(skipped)[40:]
    assert found[: AHEAD - 1] == pytest.approx([LAG + PREVIEW + 1.0] * (AHEAD - 1))
    assert found[AHEAD - 1 :] == pytest.approx([LAG + PREVIEW] * (20 - AHEAD + 1))
    # Nothing is due: no number.
    assert np.isnan(latencies([*steady, None])[-1])


def test_the_latency_begins_anew_with_a_sender() -> None:
    times: list[float | None] = [*(1000.0 + STEP * k for k in range(20)), *(STEP * k for k in range(20))]
    assert latencies(times, [1] * 20 + [2] * 20) == pytest.approx([LAG + PREVIEW] * 40)


@pytest.fixture(scope="module")
def session() -> LiveSession:
    engine = "pybullet" if find_spec("kinemimic_native") is None else "native"
    return begin_live_session(tracker_path("tracker").parent, engine, LiveSettings(), named=scenario)


def test_words_and_restart(session: LiveSession) -> None:
    clip = walker(seconds=1.5, rate=30.0).clip
    assert session.words() == ["waiting for frames"]
    for k in range(5):
        session.apply(frame_of(clip.times[k], clip.positions[k]))
        session.advance()
    assert session.words() == ["receiving frames: waiting for frames that show both legs and the trunk"]
    for k in range(5, len(clip.times)):
        session.apply(frame_of(clip.times[k], clip.positions[k]))
        session.advance()
    follows, counts = session.words()
    assert follows.startswith("**following the person**, 5")
    assert counts.startswith(f"Kinect v1, z up, in m, {len(clip.times)} frames, 0 late")
    assert counts.endswith("appeared 1 time")
    # A humanoid that is put back begins the next control step on its reference.
    session.apply(Restart(0.0))
    root = session._batch.bodies.positions[0, 0].copy()
    session._advance_reference()
    wanted = session._live.bodies(np.array([session._live.present])).positions[0, 0]
    assert root == pytest.approx(wanted, abs=1e-4)
    session.apply(frame_of(9.0, np.zeros((33, 3))))
    assert session.words()[-1].startswith("refused: 1 (last: expected frames of 20 joints")
    for _ in range(CONTROL_RATE):
        session.advance()
    assert session.words()[1] == "**no frames for 1 s: standing**"
    session.close()
