"""Spatiotemporal parameters of a gait: measure each stride, then mean, standard deviation and symmetry.

A stride goes from a foot strike to the next strike of the same foot. Lengths are measured between footprints:
the stride length from one print of the foot to its next; the step length along that line, from the other
foot's print in between; the step width across it (Huxham, Gong, Baker, Morris and Iansek 2006, Gait & Posture
23(2), 159-163). They need no direction of progression and hold on a curved path too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gait.events import FootEvents, detect_foot_events
from kinemimic.pipeline.gait.footprints import footprints
from kinemimic.pipeline.gravity import GRAVITY
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N
from kinemimic.pipeline.kinematics.skeleton import SIDES
from kinemimic.pipeline.locomotion.bouts import Bout, find_bouts

# A stride that deviates more from its pass' period, or from the median of all strides, is from starting,
# stopping or turning, or from legs exchanged by the sensor.
MAX_TIME_DEVIATION, MAX_LENGTH_DEVIATION = 0.20, 0.40
MIN_SEEN = 0.8  # share of a stride in which the capture must show hips and ankles


@dataclass(frozen=True)
class Stride:
    """One stride of one foot; times in seconds, lengths in metres, shares of the stride's time.

    group: number of the bout; start, off, end: foot strike, foot off, next foot strike; step_time,
    step_length, width: of the step that ends the stride.
    """

    group: int
    side: str
    start: float
    off: float
    end: float
    length: float
    step_time: float
    step_length: float
    width: float
    double_support: float
    flight: float

    @property
    def time(self) -> float:
        return self.end - self.start


# Name in the report -> value for one stride.
MEASURES: dict[str, Callable[[Stride], float]] = {
    "cadence_steps_per_min": lambda stride: 120.0 / stride.time,
    "speed_m_s": lambda stride: stride.length / stride.time,
    "stride_time_s": lambda stride: stride.time,
    "stride_length_m": lambda stride: stride.length,
    "step_time_s": lambda stride: stride.step_time,
    "step_length_m": lambda stride: stride.step_length,
    "step_width_m": lambda stride: stride.width,
    "stance_ratio": lambda stride: (stride.off - stride.start) / stride.time,
    "double_support_ratio": lambda stride: stride.double_support,
    "flight_ratio": lambda stride: stride.flight,
}


@dataclass(frozen=True)
class Gait:
    """The strides of a recording.

    strides: those used, bout by bout; left_out: number of the others; bouts: by number, those of the strides;
    groups: (T,) number of the bout of each frame, -1 outside any; feet: foot events of each bout; belt: m/s
    at which the feet carry a body that stays in place, as on a treadmill, None over the ground; running:
    whether most strides are running; leg: median length in metres, hip to knee to ankle; backward: number of
    bouts of walking backward, which are left out.
    """

    strides: tuple[Stride, ...]
    left_out: int
    bouts: Mapping[int, Bout]
    groups: NDArray[np.int32]
    feet: Mapping[int, FootEvents]
    belt: float | None
    running: bool
    leg: float
    backward: int = 0


def measure_gait(times: Array, passes: NDArray[np.int32], positions: Array, *, toes: bool = True) -> Gait:
    """The gait of a recording: times (T,), pass numbers (T,), -1 outside any pass, positions (T, 20, 3).

    toes: as for `find_bouts`. `strides` is empty if nobody walks a full stride forward: a foot that walks
    backward lands where its ankle is farthest behind, and the norms are of walking forward.
    """
    found: list[Stride] = []
    feet: dict[int, FootEvents] = {}
    bouts: dict[int, Bout] = {}
    groups = np.full(len(times), -1, dtype=np.int32)
    lacking = backward = 0
    for bout in find_bouts(times, passes, positions, toes=toes):
        if bout.backward:
            backward += 1
            continue
        one = detect_foot_events(times[bout.frames], bout)
        if one is not None:
            feet[bout.number], bouts[bout.number] = one, bout
            groups[bout.frames] = bout.number
            strides, unseen = _strides(bout.number, one)
            found += [s for s in strides if abs(s.time - bout.period) <= MAX_TIME_DEVIATION * bout.period]
            lacking += unseen + len(strides)
    kept = _usual(found)
    belts = [abs(bouts[s.group].speed) for s in kept if bouts[s.group].path.source == "feet"]
    runs = sum(bouts[s.group].running for s in kept)
    return Gait(
        strides=tuple(kept),
        left_out=lacking - len(kept),
        bouts=bouts,
        groups=groups,
        feet=feet,
        belt=float(np.median(belts)) if 2 * len(belts) > len(kept) else None,
        running=2 * runs > len(kept),
        leg=_leg_length(positions),
        backward=backward,
    )


def _leg_length(positions: Array) -> float:
    """Median length of both legs over the frames that show them; NaN without any."""
    lengths = [
        sum(
            np.linalg.norm(positions[:, N[f"{b}_{side}"]] - positions[:, N[f"{a}_{side}"]], axis=-1)
            for a, b in (("hip", "knee"), ("knee", "ankle"))
        )
        for side in SIDES
    ]
    seen = np.concatenate(lengths)
    seen = seen[np.isfinite(seen)]
    return float(np.median(seen)) if len(seen) else float("nan")


def _strides(number: int, feet: FootEvents) -> tuple[list[Stride], int]:
    """The strides of a pass, and the number of others that the capture does not show well enough."""
    strides: list[Stride] = []
    unseen = 0
    prints = footprints(feet)
    for foot, side in enumerate(SIDES):
        other = 1 - foot
        for k, (start, end) in enumerate(zip(feet.strikes[foot], feet.strikes[foot][1:], strict=False)):
            off, opposite = (
                times[np.searchsorted(times, start, "right") : np.searchsorted(times, end)]
                for times in (feet.offs[foot], feet.strikes[other])
            )
            inside = slice(*np.searchsorted(feet.times, (start, end)))
            if len(off) != 1 or len(opposite) != 1 or feet.seen[inside].all(axis=1).mean() < MIN_SEEN:
                unseen += 1
                continue
            first, last = prints[foot][k : k + 2]
            between = prints[other][np.searchsorted(feet.strikes[other], opposite[0])]
            if not np.isfinite([first, last, between]).all():
                unseen += 1  # a foot that the bout never shows flat
                continue
            length = float(np.hypot(*(last - first)))
            along = (last - first) / length
            across = np.array([-along[1], along[0]])
            both, none = _support(start, off[0], end, opposite[0], feet.offs[other])
            strides.append(
                Stride(
                    group=number,
                    side=side,
                    start=float(start),
                    off=float(off[0]),
                    end=float(end),
                    length=length,
                    step_time=float(end - opposite[0]),
                    step_length=float((last - between) @ along),
                    width=abs(float((between - first) @ across)),
                    double_support=both,
                    flight=none,
                )
            )
    return strides, unseen


def _support(start: float, off: float, end: float, opposite: float, offs: Array) -> tuple[float, float]:
    """Shares of a stride in double support and in flight.

    The other foot strikes at `opposite`; `offs`: all its foot-off times. It leaves the ground after the
    stride begins in walking, before it in running, and again before the stride ends.
    """
    k = int(np.searchsorted(offs, opposite))
    before = max(float(offs[k - 1]) if k > 0 else start, start)
    after = min(float(offs[k]) if k < len(offs) else end, end)
    both = min(before, off) - start + max(0.0, min(off, after) - opposite)
    none = (end - start) - (off - start) - (before - start) - (after - opposite) + both
    return float(both / (end - start)), float(none / (end - start))


def _usual(strides: list[Stride]) -> list[Stride]:
    """The strides close to the median in time and length."""
    if not strides:
        return []
    time, length = (float(np.median([getattr(s, name) for s in strides])) for name in ("time", "length"))
    return [
        stride
        for stride in strides
        if abs(stride.time - time) <= MAX_TIME_DEVIATION * time
        and abs(stride.length - length) <= MAX_LENGTH_DEVIATION * length
    ]


def summary(values: Sequence[float]) -> dict[str, float | int | None]:
    """Mean, sample standard deviation (n - 1; None for a single value) and count."""
    n = len(values)
    return {
        "mean": float(np.mean(values)) if n else None,
        "sd": float(np.std(values, ddof=1)) if n > 1 else None,
        "n": n,
    }


def symmetry_index(left: float | None, right: float | None) -> float | None:
    """Symmetry index: difference of the sides in per cent of their mean, positive if the left is larger.

    SI = 100 (L - R) / ((L + R) / 2): Robinson, Herzog and Nigg 1987, Journal of Manipulative and
    Physiological Therapeutics 10(4), 172-176. None if a side is unknown or the sum is not positive.
    """
    if left is None or right is None or left + right <= 0.0:
        return None
    return 200.0 * (left - right) / (left + right)


def parameters(gait: Gait) -> dict[str, dict[str, Any]]:
    """Per measure "both", "left" and "right", each a `summary`, and "symmetry_percent" of the sides."""
    table: dict[str, dict[str, Any]] = {}
    for name, measure in MEASURES.items():
        sides = {side: [measure(s) for s in gait.strides if s.side == side] for side in SIDES}
        row: dict[str, Any] = {
            "both": summary([measure(s) for s in gait.strides]),
            **{side: summary(values) for side, values in sides.items()},
        }
        row["symmetry_percent"] = symmetry_index(row["left"]["mean"], row["right"]["mean"])
        table[name] = row
    return table


def normalised(gait: Gait) -> dict[str, float]:
    """Dimensionless speed and stride length, comparable between subjects of different size.

    Speed over the root of gravity times leg length, length over leg length: Hof 1996, Gait & Posture 4(3),
    222-223.
    """
    speed = float(np.mean([MEASURES["speed_m_s"](s) for s in gait.strides]))
    length = float(np.mean([s.length for s in gait.strides]))
    return {"speed": speed / float(np.sqrt(GRAVITY * gait.leg)), "stride_length": length / gait.leg}
