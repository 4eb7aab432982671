"""Senders of a live capture: their clocks, layouts and interruptions, one after another."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from samples.live_stream import CLIP, STEP, TIMES, frames, in_layout, played, seen, truth

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.kinematics.rotations import conjugate, rotate
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.live.capture import LiveCapture
from kinemimic.pipeline.live.frame import CapturedFrame, frame_of
from kinemimic.pipeline.live.layouts import LAYOUTS
from kinemimic.pipeline.live.recogniser import _TURNS, UP_NAMES, Recogniser
from kinemimic.pipeline.readers.landmarks.joint_sets import SETS, JointSet


def test_a_sender_that_stops_and_comes_back() -> None:
    part = frames()[:60]
    later = [frame_of(one.time + 7.0, one.arrays()[0]) for one in frames()[:60]]
    out = played([*part, *later], until=later[-1].time)
    quiet = out[int((part[-1].time + 0.2) / STEP) : int(6.9 / STEP)]
    assert not any(moment is not None and moment.shows_person for moment in quiet)
    assert len(seen(out[int(7.3 / STEP) :])) > 18


def test_another_layout_is_refused_and_the_first_goes_on() -> None:
    recogniser = Recogniser()
    recogniser.take(frames()[0])
    with pytest.raises(KinemimicError, match="expected frames of 20 joints"):
        recogniser.take(frame_of(1.0, np.ones((25, 3))))


def steadily(capture: LiveCapture, sent: Sequence[CapturedFrame]) -> None:
    """A frame in every control step."""
    for frame in sent:
        with suppress(KinemimicError):
            capture.take(frame)
        capture.advance()


def test_times_in_milliseconds_are_a_complaint() -> None:
    capture = LiveCapture(step=STEP)
    steadily(capture, frames(times=1000.0 * np.arange(len(TIMES)) / 30.0)[:40])
    assert capture.complaint == "expected times in seconds, found frames 33.3 s apart"
    steadily(capture, frames()[:20])
    assert capture.complaint == ""
    assert capture.frames == 20


def test_times_in_another_unit_that_thin_all_frames_are_a_complaint() -> None:
    capture = LiveCapture(step=STEP)
    steadily(capture, frames(times=1e-3 * TIMES)[:70])
    assert capture.complaint == "expected times in seconds, found frames 1.67e-05 s apart"
    assert capture.thinned > 60


def test_a_fast_sender_is_thinned_without_a_complaint() -> None:
    capture = LiveCapture(step=STEP)
    for k in range(1000):
        capture.take(frame_of(0.001 * k, CLIP.positions[0]))
        assert capture.complaint == ""
    assert capture.thinned == 1000 - capture.frames > 900


def test_the_next_sender_is_read_with_its_own_axes_and_unit() -> None:
    turn, other = _TURNS[UP_NAMES["y"]], _TURNS[UP_NAMES["z"]]
    first = frames(rotate(conjugate(turn), CLIP.positions))[:40]
    second = frames(1000.0 * rotate(conjugate(other), CLIP.positions), TIMES + TIMES[39] + 1.0)
    capture = LiveCapture(step=STEP)
    played(first, capture)
    assert capture.reading is not None
    assert (capture.reading.up, capture.reading.unit) == ("y", "m")
    found = seen([one for one in played(second, capture) if one is not None and one.time > second[9].time])
    assert (capture.reading.up, capture.reading.unit) == ("z", "mm")
    moment = found[-1]
    expected = truth(replace(moment, time=moment.time - TIMES[39] - 1.0))
    assert np.abs(moment.positions[moment.now] - expected).max() < 0.02


def test_a_sender_whose_clock_began_again_is_read_anew() -> None:
    capture = LiveCapture(step=STEP)
    steadily(capture, frames(times=TIMES + 100.0)[:40])
    steadily(capture, frames(100.0 * CLIP.positions)[:40])
    assert capture.reading is not None
    assert capture.reading.unit == "cm"
    assert capture.late == 0
    assert capture.frames == 80


def test_a_stray_frame_of_another_layout_does_not_shut_out_the_sender() -> None:
    capture = LiveCapture(step=STEP)
    others = [in_layout(LAYOUTS[33], positions) for positions in CLIP.positions]
    capture.take(frames()[0])
    steadily(capture, [frame_of(k * STEP, others[k]) for k in range(60)])
    assert 10 < capture.refused < 20
    assert "expected frames of 20 joints" in capture.last_fault
    assert capture.senders == 2
    # While the sender sends, another is refused.
    capture = LiveCapture(step=STEP)
    for k in range(60):
        steadily(capture, [frame_of(k * STEP, CLIP.positions[k]), frame_of(k * STEP, others[k])])
    assert (capture.refused, capture.frames) == (60, 60)


@pytest.mark.parametrize("wrong", [1e6, -50.0, 3.0])
def test_a_frame_with_a_wrong_time_is_left_out_and_the_stream_goes_on(wrong: float) -> None:
    sent = frames()
    stray = frame_of(sent[50].time + wrong, CLIP.positions[50])
    capture, sound = LiveCapture(step=STEP), LiveCapture(step=STEP)
    for k, frame in enumerate(sent):
        capture.take(stray if k == 50 else frame)
        sound.take(frame)
        if k % 2 == 0:  # the walker has 60 frames a second
            continue
        moment, expected = capture.advance(), sound.advance()
        if moment is None or expected is None:
            assert moment is expected
            continue
        assert moment.shows_person == expected.shows_person
        assert np.nanmax(np.abs(moment.positions[moment.now] - expected.positions[expected.now])) < 0.01
    assert (capture.senders, capture.refused, capture.frames) == (1, 1, len(sent) - 1)
    assert "expected a time near 0.85 s" in capture.last_fault


def test_no_human_size_is_refused() -> None:
    capture = LiveCapture(step=STEP)
    with pytest.raises(KinemimicError, match="leg of human length"):
        for frame in frames(0.001 * CLIP.positions)[:20]:
            capture.take(frame)
    assert capture.advance() is None


def only(name: str) -> JointSet:
    return next(joint_set for joint_set in SETS if joint_set.name == name)


@pytest.mark.parametrize("name", ["OpenPose BODY_25", "UTD-MHAD, 20 joints"])
def test_joints_in_the_order_of_another_program(name: str) -> None:
    sent = np.array([in_layout(only(name), positions) for positions in CLIP.positions])
    capture = LiveCapture(step=STEP)
    moment = seen(played(frames(sent), capture))[-1]
    assert capture.reading is not None
    assert capture.reading.layout.name == name
    legs = [N[f"{joint}_{side}"] for side in ("left", "right") for joint in ("hip", "knee", "ankle")]
    assert np.abs(moment.positions[moment.now] - truth(moment))[legs].max() < 0.02


def test_joints_in_an_unknown_order_are_refused() -> None:
    capture = LiveCapture(step=STEP)
    steadily(capture, frames(CLIP.positions[:, ::-1])[:20])
    assert capture.reading is None
    assert "expected 20 joints in the order of Kinect v1, found legs" in capture.last_fault


def test_a_pelvis_at_the_origin_is_between_the_hips() -> None:
    relative = CLIP.positions - CLIP.positions[:, :1]
    capture = LiveCapture(step=STEP)
    moment = seen(played(frames(relative), capture))[-1]
    assert np.linalg.norm(moment.positions[moment.now, N["hip_center"]]) < 0.12


def test_a_short_clip_that_is_sent_again_and_again() -> None:
    """Its clock begins anew within the window, where frames also come late."""
    capture, clip = LiveCapture(step=STEP), frames()[:45]
    for _ in range(4):
        steadily(capture, clip)
    assert capture.senders == 4
    assert capture.frames > 90


def test_a_clock_that_stands_still_is_said() -> None:
    capture = LiveCapture(step=STEP)
    for positions in CLIP.positions[:30]:
        with suppress(KinemimicError):
            capture.take(frame_of(5.0, positions))
        capture.advance()
    assert "expected a later time in every frame, found 5 s again and again" in capture.complaint


def test_after_a_pause_the_axes_are_the_same_whatever_the_pose() -> None:
    """The person bends by 90 degrees while nothing is sent."""
    capture = LiveCapture(step=STEP)
    steadily(capture, frames())
    assert capture.reading is not None
    assert capture.reading.up == "z"
    legs = [N[f"{joint}_{side}"] for side in SIDES for joint in ("hip", "knee", "ankle", "foot")]
    upper = np.setdiff1d(np.arange(20), legs)
    bent, hips = CLIP.positions.copy(), CLIP.positions[:, :1]
    _, y, z = np.moveaxis(bent[:, upper] - hips, -1, 0)
    bent[:, upper] = hips + np.stack([2.0 * z, y, -0.3 * z], axis=-1)
    steadily(capture, frames(bent, TIMES + TIMES[-1] + 1.0))
    assert capture.senders == 2
    assert capture.reading.up == "z"


@pytest.mark.parametrize("size", [0.0, 1000.0])
def test_legs_of_another_length_are_nobodys(size: float) -> None:
    """All joints in one place, as bridges show somebody who is lost; or another unit."""
    capture = LiveCapture(step=STEP)
    steadily(capture, frames()[:40])
    used = capture.frames
    there = CLIP.positions * size + [0.0, 0.0, 1.2]
    steadily(capture, frames(there)[40:48])
    assert capture.frames == used
    with suppress(KinemimicError):
        steadily(capture, frames(there)[48:75])
    assert capture.reading is not None
    assert capture.reading.unit == ("m" if size == 0.0 else "mm")
