"""Which bouts of walking become one loop: those that walk alike."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from kinemimic.pipeline.locomotion.bouts import Bout

# From the bout with the most usable strides: share of its period; share of its speed, or m/s if that is more,
# since around zero a share means nothing.
MAX_PERIOD_SPREAD, MAX_SPEED_SPREAD, MIN_SPEED_SPREAD = 0.20, 0.30, 0.15
MIN_CYCLES = 0.75  # strides; of a runner who crosses a sensor's view


@dataclass(frozen=True)
class Selection:
    """bouts: those to pool, none if no loop can be made; reasons: number of each other bout -> why it is not
    used."""

    bouts: tuple[Bout, ...]
    reasons: dict[int, str]

    @property
    def strides(self) -> float:
        """Number of strides that are pooled, with parts of strides."""
        return sum(one.used_strides for one in self.bouts)


def select_bouts(bouts: list[Bout]) -> Selection:
    """The bouts to pool: the one with the most usable strides, and those that walk like it."""
    reasons = {one.number: _unusable(one) for one in bouts if _unusable(one)}
    usable = [one for one in bouts if one.number not in reasons]
    if not usable:
        return Selection((), reasons)
    best = max(usable, key=lambda one: one.used_strides)
    for one in usable:
        if one.running != best.running:
            reasons[one.number] = "walks, the others run" if best.running else "runs, the others walk"
        elif abs(one.speed - best.speed) > max(MAX_SPEED_SPREAD * abs(best.speed), MIN_SPEED_SPREAD):
            reasons[one.number] = f"{one.speed:.2f} m/s, the others {best.speed:.2f}"
        elif abs(one.period - best.period) > MAX_PERIOD_SPREAD * best.period:
            reasons[one.number] = f"strides of {one.period:.2f} s, the others {best.period:.2f}"
    return Selection(tuple(one for one in usable if one.number not in reasons), reasons)


def _unusable(one: Bout) -> str:
    if one.backward:
        return "walks backward, which a loop does not support"
    if one.used_strides < MIN_CYCLES:
        return f"no stride is good enough: {why_strides_are_left_out([one])}"
    return ""


def why_strides_are_left_out(bouts: list[Bout] | tuple[Bout, ...]) -> str:
    """Reasons and counts of the strides of bouts that are not used, or with one leg only; "" if all are."""
    counted = Counter(stride.reason for one in bouts for stride in one.strides if stride.reason)
    return ", ".join(f"{count} x {reason}" for reason, count in counted.most_common())
