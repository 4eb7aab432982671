"""Where the ankles meet between two moments with the feet apart, and whether they do as a walker's do.

A walker's foot comes from behind, passes the other one quickly, and goes on ahead. If one foot always leads,
the ankles meet without passing each other, too: in kicks and lunges, the foot that was ahead comes back; in
steps to the other foot, the feet stay beside each other.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.signal import find_peaks

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.locomotion.even_clock import RATE
from kinemimic.pipeline.locomotion.path.heading import along_heading, body_heading

# Of the ankles' distance, in its amplitude (1.41 times its rms): what counts as feet apart, and as feet that
# meet in between.
APART, PROMINENCE, MEETING = 0.4, 0.3, 0.5
STEP_TIMES = (0.25, 1.2)  # s between feet apart and feet apart again
MIN_AMPLITUDE = 0.10  # m; a person who stands does not step
# By how much the share of one foot in the ankles' relative movement may change where they meet: 0 of a foot
# that goes on, over a floor or a belt, and 1 of a foot that comes back while the other one stands. A depth
# sensor's noise scatters it: the median of a stretch of steps was at most 0.75 in 81 of 85 of Kinect walks.
MAX_CHANGE = 0.75
# Share of the time from feet apart to feet apart that they are less than half as far apart: 1/3 of an even
# swing from behind to ahead, 1/2 of an even swing from ahead to beside and ahead again.
MAX_TOGETHER = 0.42
FEWEST = 4  # meetings of which that is asked: two strides


@dataclass(frozen=True)
class _Meeting:
    """sample: of the even clock; passing: whether the other foot is ahead then; change, together: see
    MAX_CHANGE and MAX_TOGETHER.
    """

    sample: int
    passing: bool
    change: float
    together: float


@dataclass
class Steps:
    """Steps that follow each other, from a sample of the even clock on."""

    start: int
    meetings: list[_Meeting] = field(default_factory=list)

    @property
    def not_passing(self) -> list[int]:
        """Samples at which a walker's ankles meet without passing each other; none if one foot leads."""
        found = [meeting for meeting in self.meetings if not meeting.passing]
        # A single meeting is noisy; people do not change between walking and kicking from step to step.
        if not found or float(np.median([meeting.change for meeting in found])) > MAX_CHANGE:
            return []
        # A few short steps, as where somebody turns round, are no gait of one leg that always leads.
        together = float(np.median([meeting.together for meeting in self.meetings]))
        if len(self.meetings) >= FEWEST and together > MAX_TOGETHER:
            return []
        return [meeting.sample for meeting in found]


def steps(positions: Array) -> list[Steps]:
    """The stretches of steps, each to the start of the next; none of a person who stands.

    positions: (T, 20, 3) of an even pass.
    """
    heading = body_heading(positions, RATE)[0]
    ahead = along_heading(positions[:, N["ankle_right"]] - positions[:, N["ankle_left"]], heading)[:, 0]
    amplitude = float(np.sqrt(2.0 * np.mean(ahead**2)))
    if amplitude < MIN_AMPLITUDE:
        return []
    distance = np.abs(ahead)
    peaks, _ = find_peaks(
        distance,
        height=APART * amplitude,
        prominence=PROMINENCE * amplitude,
        distance=max(1, round(STEP_TIMES[0] * RATE)),
    )
    out = [Steps(0)]
    for one, other in pairwise(peaks.tolist()):
        middle = int(one + np.argmin(distance[one : other + 1]))
        if (other - one) / RATE > STEP_TIMES[1]:
            out.append(Steps(one))
        elif distance[middle] < MEETING * amplitude:
            names = ("ankle_left", "ankle_right") if ahead[one] > 0.0 else ("ankle_right", "ankle_left")
            ankles = positions[[one, middle, other]][:, [N[name] for name in names]]
            change = _change(ankles, float(heading[middle]))
            together = _together(distance[one : other + 1], middle - one)
            out[-1].meetings.append(_Meeting(middle, ahead[one] * ahead[other] < 0.0, change, together))
    return out


def _change(ankles: Array, heading: float) -> float:
    """Change of the share of the foot from behind, which goes ahead under the other's name.

    ankles: (3, 2, 3) before, at and after the meeting; at first, the first of the two is behind.
    """
    along = ankles[..., :2] @ np.array([np.cos(heading), np.sin(heading)])
    (behind, ahead), (goes_back, goes_ahead) = np.diff(along, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(abs(behind / (behind - ahead) - goes_ahead / (goes_ahead - goes_back)))


def _together(distance: Array, middle: int) -> float:
    """Share of the samples around the middle at less than half of the smaller distance at either end."""
    far = np.flatnonzero(distance >= 0.5 * min(distance[0], distance[-1]))
    before, after = far[far < middle].max(initial=0), far[far > middle].min(initial=len(distance) - 1)
    return float(after - before - 1) / (len(distance) - 1)
