"""Spatiotemporal parameters of a gait: every stride measured by itself, then mean, spread and symmetry.

A stride goes from a foot's strike to its next one. Lengths are taken between ankles: a stride's from where
the ankle came down to where it comes down again; a step's along that line, from the other ankle where it came
down in between; the step's width across it (Huxham, Gong, Baker, Morris and Iansek 2006, Gait & Posture
23(2), 159-163). They need no direction of progression and hold on a curved path too. The width is that of
where both feet lie flat: the ankle is farthest ahead in late swing, which may come in from the side.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.gait.events import SIDES, FootEvents, detect_foot_events
from kinemimic.pipeline.gait.harmonic import fit_harmonic
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX as N

GRAVITY = 9.81
# A stride that strays further from its pass' period, or from the median of all strides, is one of setting
# off, stopping, turning, or of legs exchanged by the sensor.
TIME_SPREAD, LENGTH_SPREAD = 0.20, 0.40
# The median of the few strides of a short pass may itself be wrong. Of a pass no longer than this (s) the
# ankles' harmonic tells the period, if it explains so much of their variance (as in retarget/cycle.py).
SHORT, EXPLAINED = 30.0, 0.85
SEEN = 0.8  # share of a stride in which the capture must show hips and ankles


@dataclass(frozen=True)
class Stride:
    """One stride of one foot; times in seconds, lengths in metres, shares of the stride's time.

    group: number of the pass; start, off, end: the foot's strike, its leaving the ground, its next strike;
    step_time, step_length: of the step that ends the stride; width: of the step.
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


# Name in the report -> what it is of one stride.
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
    """The strides of a recording, of all its passes.

    strides: those that count, pass by pass; left_out: how many more there were; feet: of each pass in which
    somebody walks; belt: m/s, None on firm ground; running: whether most strides are of running; leg: median
    length in metres, hip to knee to ankle.
    """

    strides: tuple[Stride, ...]
    left_out: int
    feet: Mapping[int, FootEvents]
    belt: float | None
    running: bool
    leg: float


def measure_gait(times: Array, passes: NDArray[np.int32], positions: Array) -> Gait:
    """The gait in a recording: times (T,), number of the pass (T,), -1 outside of any, positions (T, 20, 3).

    `strides` is empty where nobody walks, or never for a whole stride.
    """
    found: list[Stride] = []
    feet: dict[int, FootEvents] = {}
    lacking = 0
    for number in np.unique(passes[passes >= 0]).tolist():
        mine = passes == number
        one = detect_foot_events(times[mine], positions[mine])
        if one is not None:
            feet[number] = one
            strides, unseen = _strides(number, one)
            period = _period(one)
            found += [s for s in strides if period is None or abs(s.time - period) <= TIME_SPREAD * period]
            lacking += unseen + len(strides)
    kept = _usual(found)
    belt = float(np.median([feet[s.group].belt for s in kept])) if kept else 0.0
    runs = sum(feet[s.group].running for s in kept)
    return Gait(
        strides=tuple(kept),
        left_out=lacking - len(kept),
        feet=feet,
        belt=belt if belt > 0 else None,
        running=2 * runs > len(kept),
        leg=_leg_length(positions),
    )


def _leg_length(positions: Array) -> float:
    """Median over both legs and all frames that show them; NaN without any."""
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
    """The strides of a pass, and how many of them the capture does not show well enough to measure."""
    strides: list[Stride] = []
    unseen = 0
    for foot, side in enumerate(SIDES):
        other = 1 - foot
        for start, end in zip(feet.strikes[foot], feet.strikes[foot][1:], strict=False):
            off, opposite = (
                times[np.searchsorted(times, start, "right") : np.searchsorted(times, end)]
                for times in (feet.offs[foot], feet.strikes[other])
            )
            inside = slice(*np.searchsorted(feet.times, (start, end)))
            if len(off) != 1 or len(opposite) != 1 or feet.seen[inside].mean() < SEEN:
                unseen += 1
                continue
            first, last, between = (
                _at(feet, *place) for place in ((foot, start), (foot, end), (other, opposite[0]))
            )
            length = float(np.hypot(*(last - first)))
            along, step = (last - first) / length, last - between
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
                    step_length=float(step @ along),
                    width=_width(feet, foot, along, float(start), float(opposite[0]), float(off[0] - start)),
                    double_support=both,
                    flight=none,
                )
            )
    return strides, unseen


def _width(feet: FootEvents, foot: int, along: Array, start: float, opposite: float, stance: float) -> float:
    """Metres across the unit vector `along` (2,) between where a foot stands and the other one after it.

    They come down at `start` and `opposite`. In the second quarter of a stance, which takes `stance` seconds,
    a foot lies flat: before it may not have landed, later the heel rises.
    """
    across = []
    for which, strike in ((foot, start), (1 - foot, opposite)):
        first, last = np.searchsorted(feet.times, (strike + stance / 4.0, strike + stance / 2.0))
        x, y = feet.ankles[first : max(last, first + 1), which, :2].T
        across.append(np.median(along[0] * y - along[1] * x))
    return float(abs(across[1] - across[0]))


def _support(start: float, off: float, end: float, opposite: float, offs: Array) -> tuple[float, float]:
    """Shares of a stride with both feet on the ground and with none.

    The other foot comes down at `opposite`; `offs`: when it leaves the ground, now and at other times. In
    walking that is after the stride has begun, in running before, and again before it ends.
    """
    k = int(np.searchsorted(offs, opposite))
    before = max(float(offs[k - 1]) if k > 0 else start, start)
    after = min(float(offs[k]) if k < len(offs) else end, end)
    both = min(before, off) - start + max(0.0, min(off, after) - opposite)
    none = (end - start) - (off - start) - (before - start) - (after - opposite) + both
    return float(both / (end - start)), float(none / (end - start))


def _period(feet: FootEvents) -> float | None:
    """Seconds of a stride in a short pass, from all of its frames; None where they do not agree on one."""
    if feet.times[-1] - feet.times[0] > SHORT:
        return None
    apart = np.sum((feet.ankles[:, 1, :2] - feet.ankles[:, 0, :2]) * feet.forward, axis=1)
    # A third of the clock's moments tell a period as well as all of them.
    harmonic = fit_harmonic(feet.times[::3], apart[::3])
    return harmonic.period if harmonic.r2 > EXPLAINED else None


def _at(feet: FootEvents, foot: int, moment: float) -> Array:
    """Place (2,) of an ankle over the ground."""
    k = int(np.clip(np.searchsorted(feet.times, moment), 1, len(feet.times) - 1))
    share = (moment - feet.times[k - 1]) / (feet.times[k] - feet.times[k - 1])
    before, after = feet.ankles[k - 1, foot, :2], feet.ankles[k, foot, :2]
    return np.asarray(before + share * (after - before))


def _usual(strides: list[Stride]) -> list[Stride]:
    """Those near the median in time and length."""
    if not strides:
        return []
    time, length = (float(np.median([getattr(s, name) for s in strides])) for name in ("time", "length"))
    return [
        stride
        for stride in strides
        if abs(stride.time - time) <= TIME_SPREAD * time
        and abs(stride.length - length) <= LENGTH_SPREAD * length
    ]


def summary(values: Sequence[float]) -> dict[str, float | int | None]:
    """Mean, standard deviation (of a sample: n - 1; None for one alone) and count."""
    n = len(values)
    return {
        "mean": float(np.mean(values)) if n else None,
        "sd": float(np.std(values, ddof=1)) if n > 1 else None,
        "n": n,
    }


def symmetry_index(left: float | None, right: float | None) -> float | None:
    """Difference of the sides in per cent of their mean, positive where the left is larger.

    SI = 100 (L - R) / ((L + R) / 2): Robinson, Herzog and Nigg 1987, Journal of Manipulative and
    Physiological Therapeutics 10(4), 172-176. None where a side is not known, or neither is above zero.
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
    """Speed and stride length without dimension, so that walkers of different size compare.

    Speed over the root of gravity times leg length, length over leg length: Hof 1996, Gait & Posture 4(3),
    222-223.
    """
    speed = float(np.mean([MEASURES["speed_m_s"](s) for s in gait.strides]))
    length = float(np.mean([s.length for s in gait.strides]))
    return {"speed": speed / float(np.sqrt(GRAVITY * gait.leg)), "stride_length": length / gait.leg}
