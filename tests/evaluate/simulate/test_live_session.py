"""A session behind a live capture: what it tells, how far it is behind, where it puts the humanoid."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest
from samples.walker import walker

from kinemimic.evaluate.simulate.frame import LiveSettings
from kinemimic.evaluate.simulate.inputs import Restart
from kinemimic.evaluate.simulate.live_session import LiveSession
from kinemimic.evaluate.simulate.recording import begin_live_session
from kinemimic.pipeline.live.capture import LAG
from kinemimic.pipeline.live.frame import frame_of
from kinemimic.train.rollout.tracker_file import tracker_path
from kinemimic.train.scenario.scenario_file import scenario
from kinemimic.train.sim.world import CONTROL_RATE


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
    # The lag of the filter, and no more.
    assert follows == f"**following the person**, {1000.0 * LAG:.0f} ms behind"
    assert session.shown is not None
    assert session.shown.latency == pytest.approx(LAG)
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
    assert session.shown is not None
    assert np.isnan(session.shown.latency)
    assert session.words()[1] == "**no frames for 1 s: standing**"
    session.close()
