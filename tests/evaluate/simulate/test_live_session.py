"""A session behind a live capture: what it tells, how far it is behind, where it puts the humanoid."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest
from samples.walker import changing_bones, walker

from kinemimic.evaluate.simulate.frame import LiveSettings
from kinemimic.evaluate.simulate.inputs import Restart
from kinemimic.evaluate.simulate.live_session import LiveSession
from kinemimic.evaluate.simulate.recording import begin_live_session
from kinemimic.pipeline.live.capture import LAG, LiveCapture
from kinemimic.pipeline.live.frame import frame_of
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.retarget.live.performer import Performer
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


@pytest.mark.parametrize("denoise", [True, False])
def test_noise_is_removed_unless_it_shall_stay(session: LiveSession, denoise: bool) -> None:
    """Against what the capture shows: the same poses without denoising, others with it after a second."""
    clip = changing_bones(walker(seconds=3.0, rate=30.0).clip)
    live = begin_live_session(
        tracker_path("tracker").parent, session._engine, LiveSettings(denoise=denoise), named=scenario
    )
    capture, performer = LiveCapture(step=1.0 / CONTROL_RATE), Performer(float(CONTROL_RATE))
    off, noise = [], []
    for k in range(len(clip.times)):
        frame = frame_of(clip.times[k], clip.positions[k])
        live.apply(frame)
        capture.take(frame)
        shown, wanted = live.advance(), performer.perform(capture.advance())
        curves = joint_angles(wanted.rotations[None])
        off.append(max(abs(shown.wanted[name] - float(curve[0])) for name, curve in curves.items()))
        noise.append(wanted.noise)
    live.close()
    assert noise[-1] == 1.0
    degrees, precise = np.degrees(off), np.array(noise) == 0.0
    assert degrees[precise].max() < 0.1
    if denoise:
        assert degrees[-15:].mean() > 1.0
    else:
        assert degrees.max() < 0.1
