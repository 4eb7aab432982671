"""A session behind a live capture: what it tells, how far it is behind, where it puts the humanoid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from samples.walker import changing_bones, walker

from kinemimic.evaluate.simulate.session.frame import LiveSettings
from kinemimic.evaluate.simulate.session.inputs import Restart
from kinemimic.evaluate.simulate.session.live_session import LiveSession
from kinemimic.evaluate.simulate.session.recording import begin_live_session
from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.rotations import from_axis_angle, multiply
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.live.capture import LAG, LiveCapture, Moment
from kinemimic.pipeline.live.frame import frame_of
from kinemimic.retarget.feet.scale import body_kinematics
from kinemimic.retarget.humanoid.motion import joint_angles
from kinemimic.retarget.live.performer import Performed, Performer, standing
from kinemimic.train.rollout.tracker_file import tracker_path
from kinemimic.train.scenario.scenario_file import find_scenario
from kinemimic.train.sim.world import CONTROL_RATE


@pytest.fixture(scope="module")
def session() -> LiveSession:
    engine = "pybullet" if find_spec("kinemimic_native") is None else "native"
    return begin_live_session(tracker_path("tracker").parent, engine, LiveSettings(), named=find_scenario)


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
        tracker_path("tracker").parent, session._engine, LiveSettings(denoise=denoise), named=find_scenario
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


def squats(count: int, rate: float) -> Array:
    """Positions (T, 20, 3) of somebody who squats, 3 s each, with the centre of mass over the feet."""
    phase = np.arange(round(3.0 * count * rate)) / (3.0 * rate)
    bend = np.radians(70.0) * 0.5 * (1.0 - np.cos(2.0 * np.pi * phase))
    rotations = np.tile(standing(), (len(bend), 1, 1))
    for side in ("left", "right"):
        for joint, share in (("hip", -1.15), ("knee", 1.0), ("ankle", -0.35)):
            node = N[f"{joint}_{side}"]
            rotations[:, node] = multiply(rotations[:, node], from_axis_angle("Y", share * bend))
    rotations[:, 0] = from_axis_angle("Y", 0.5 * bend)
    positions, _ = body_kinematics(rotations)
    feet = positions[:, [N["ankle_left"], N["ankle_right"]]].mean(axis=1, keepdims=True)
    return positions - feet + [0.0, 0.0, 0.08]


def test_a_person_who_squats_is_followed(session: LiveSession) -> None:
    """`tracker` falls; with the policy for standing, the humanoid squats as well."""
    positions = squats(3, float(CONTROL_RATE))
    found = {}
    for name in ("tracker", "standing"):
        live = begin_live_session(
            tracker_path("tracker").parent, session._engine, LiveSettings(place=True), named=find_scenario
        )
        if name == "tracker":
            live.performer.perform = going(live.performer)  # type: ignore[method-assign]
        frames = []
        for k, places in enumerate(positions):
            live.apply(frame_of(k / CONTROL_RATE, places))
            frames.append(live.advance())
        doing = "following the person" + (" on the spot" if name == "standing" else "")
        assert live.words()[0].startswith(f"**{doing}**")
        live.close()
        found[name] = frames[CONTROL_RATE:]
    assert any(one.fallen for one in found["tracker"])
    assert not any(one.fallen for one in found["standing"])
    wanted, moved = (
        np.array([getattr(one, curves)["knee_left"] for one in found["standing"]])
        for curves in ("wanted", "angles")
    )
    assert np.degrees(wanted).max() > 60.0
    assert np.mean((moved - wanted) ** 2) < 0.2 * np.var(wanted)


def going(performer: Performer) -> Callable[[Moment | None], Performed]:
    """Its frames, as of somebody who never stays on the spot."""
    perform = performer.perform
    return lambda moment: replace(perform(moment), on_the_spot=False)


def test_without_a_policy_for_it_ankles_and_hips_balance(session: LiveSession) -> None:
    live = begin_live_session(
        tracker_path("tracker").parent, session._engine, LiveSettings(), named=find_scenario
    )
    live._standing = None
    frames = [live.advance() for _ in range(3 * CONTROL_RATE)]
    live.close()
    assert not any(one.fallen for one in frames)
    assert frames[-1].bodies.positions[0, 2] > 0.8
