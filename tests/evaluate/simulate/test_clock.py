from __future__ import annotations

import pytest

from kinemimic.evaluate.simulate.clock import RESYNC, Clock


class Time:
    """A time that passes only when told."""

    def __init__(self) -> None:
        self.now, self.slept = 100.0, list[float]()

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.now += seconds


@pytest.fixture
def time() -> Time:
    return Time()


@pytest.fixture
def clock(time: Time) -> Clock:
    return Clock(10.0, now=lambda: time.now, sleep=time.sleep)


def test_beats_keep_their_rate_whatever_the_work_takes(time: Time, clock: Clock) -> None:
    begun = []
    for work in (0.0, 0.03, 0.09, 0.0, 0.05):
        clock.wait()
        begun.append(time.now)
        time.now += work
    assert begun == pytest.approx([100.0, 100.1, 100.2, 100.3, 100.4])
    assert (clock.beats, clock.late) == (5, 0)


def test_a_slow_beat_is_made_up_for(time: Time, clock: Clock) -> None:
    clock.wait()
    time.now += 0.25
    begun = []
    for _ in range(3):
        clock.wait()
        begun.append(time.now)
    assert begun == pytest.approx([100.25, 100.25, 100.3])
    assert clock.late == 1  # the one that began after the next was due


def test_a_long_pause_is_not_made_up_for(time: Time, clock: Clock) -> None:
    clock.wait()
    time.now += 2.0 * RESYNC
    clock.wait()
    before = time.now
    clock.wait()
    assert time.now == pytest.approx(before + 0.1)


def test_late_beats_are_forgotten_after_ten_seconds(time: Time, clock: Clock) -> None:
    clock.wait()
    time.now += 0.25
    clock.wait()
    assert clock.lately_on_time == 0.5
    for _ in range(100):
        clock.wait()
    assert clock.lately_on_time == 1.0
    assert clock.late == 1


def test_what_comes_before_the_first_beat_is_not_late(time: Time, clock: Clock) -> None:
    time.now += 5.0
    clock.restart()
    clock.wait()
    assert clock.late == 0


def test_slow_motion_has_longer_beats(time: Time, clock: Clock) -> None:
    clock.wait()
    clock.speed = 0.5
    clock.wait()
    clock.wait()
    assert time.now == pytest.approx(100.0 + 0.1 + 0.2) or time.now == pytest.approx(100.4)
