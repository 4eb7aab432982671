"""Division of a capture into passes: the acquisition flow of the paper's Fig. 3, run over a recording.

start -> waiting for a subject -> tracking -> subject lost -> tracking … -> end. A pass is a stretch of
tracking between two losses; no later step may combine frames across its ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Mask
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.skeleton import MISSING
from kinemimic.pipeline.quality.displaced_body import body_jumps, displaced_frames
from kinemimic.pipeline.quality.rules.repeated_poses import CLOCK_GAP, MAX_ABSENCE, LongRepeats, long_repeats

MIN_PASS_DURATION = 0.5  # s


class State(StrEnum):
    """States of the acquisition."""

    START = "start"
    WAITING = "waiting for a subject"
    TRACKING = "tracking"
    LOST = "subject lost"
    END = "end"


@dataclass(frozen=True)
class Event:
    """A change of state: index and time (seconds) of its frame, and the reason."""

    frame: int
    time: float
    state: State
    reason: str


@dataclass(frozen=True)
class Acquisition:
    """The passes of a capture.

    passes: (T,) number of the pass or -1; complete: (T,) all joints seen; events: in order of time;
    discarded: number of passes shorter than MIN_PASS_DURATION, whose frames get -1; repeats: poses that are
    repeated for long; displaced: (T,) frames in which the whole body is in another place.
    """

    passes: NDArray[np.int32]
    complete: Mask
    events: tuple[Event, ...]
    discarded: int
    repeats: LongRepeats
    displaced: Mask

    @property
    def count(self) -> int:
        """Number of passes."""
        return int(self.passes.max(initial=-1)) + 1


def find_passes(clip: Clip) -> Acquisition:
    """The passes of a clip."""
    seen = clip.states != MISSING
    repeats = long_repeats(clip)
    present = seen.any(axis=1) & ~repeats.nobody & ~repeats.frozen
    displaced = displaced_frames(clip, present)
    present &= ~displaced
    events = list(_state_machine(clip, present, repeats))
    passes = np.full(len(clip.times), -1, dtype=np.int32)
    count = discarded = 0
    for begin, end in pairwise(events):
        if begin.state is not State.TRACKING:
            continue
        last = end.frame
        while not present[last - 1]:
            last -= 1  # drop the trailing frames without a subject
        if clip.times[last - 1] - clip.times[begin.frame] < MIN_PASS_DURATION:
            discarded += 1
            continue
        passes[begin.frame : last] = count
        count += 1
    return Acquisition(passes, seen.all(axis=1) & present, tuple(events), discarded, repeats, displaced)


def with_passes(clip: Clip, acquisition: Acquisition) -> Clip:
    """The clip with its frames numbered by pass."""
    return replace(clip, passes=acquisition.passes)


def _state_machine(clip: Clip, present: Mask, repeats: LongRepeats) -> Iterator[Event]:
    """The state changes; a loss is reported at the first frame after the pass.

    While the sensor is frozen, the person is still there.
    """
    times = clip.times
    jumps = body_jumps(clip, present)
    yield Event(0, float(times[0]), State.START, "recording")
    state, last = State.WAITING, -1
    yield Event(0, float(times[0]), State.WAITING, "device open")
    for frame, time in enumerate(times.tolist()):
        if state is State.TRACKING:
            reason = ""
            if time - times[frame - 1] > CLOCK_GAP:
                reason = f"no frame for {time - times[frame - 1]:.2f} s"
            elif (last < frame - 1 or not present[frame]) and time - times[last] > MAX_ABSENCE + 1e-6:
                reason = f"nobody seen for more than {MAX_ABSENCE} s"
                if repeats.nobody[frame]:
                    reason = f"the last pose repeats for more than {MAX_ABSENCE} s: nobody seen"
            elif jumps[frame]:
                reason = "the whole body jumped"
            if reason:
                state = State.LOST
                yield Event(frame, time, state, reason)
        if present[frame] and state is not State.TRACKING:
            state = State.TRACKING
            yield Event(frame, time, state, "subject seen")
        if present[frame] or repeats.frozen[frame]:
            last = frame
    yield Event(len(times), float(times[-1]), State.END, "end of the recording")
