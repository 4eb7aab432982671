"""A claim of the paper: its number, our number, and the verdict."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

from kinemimic.pipeline.cli.html import number

Better = Literal["more", "less", "lead", "setting", "point", "incomparable", "neither"]
Failing = Literal["ours", "theirs", "both"]
BETTER, WORSE, CONFIRMED, NOT_CONFIRMED = "better", "worse", "confirmed", "not confirmed"
LARGER, SMALLER = f"{CONFIRMED}, a larger lead", f"{CONFIRMED}, a smaller lead"
CONTRADICTED = "contradicted"
UNDECIDED = "undecided: the interval contains 0"
UNSURE = "better, but the interval contains the paper's value"
UNEQUAL = "ahead, but with more samples"
SHORT = "ahead, with fewer samples than in the paper"
SAME, OTHER = "as in the paper", "other"
EARLIER, LATER = "earlier", "later"
INCOMPARABLE = "not comparable"
UNTRAINED = "no comparison: not trained on this task"


@dataclass(frozen=True)
class Best:
    """What the best of the policies that ship reaches, in a claim's unit."""

    value: float
    policy: str


@dataclass(frozen=True)
class Claim:
    """A claim, our number, and what its verdict depends on.

    figure: or table of the paper; formula: how ours is computed; paper, ours: in `unit`; better: "more" or
    "less" is better, "lead" for PPO's lead, "setting" for a choice, "point" for a place on an axis,
    "incomparable" for what no number of ours can confirm, "neither" for no verdict; reason: why ours is None,
    differs or is not comparable, and failing: the algorithm that failed; low, high: 95 % interval of ours, if
    any; unequal: PPO had more samples than the baseline; short: there were fewer samples than in the paper;
    sizes: the paper's lead and ours as ratios where the numbers themselves are not comparable (times of two
    machines); best: of our policies that ship, whatever their samples; no verdict depends on it.
    """

    figure: str
    what: str
    formula: str
    unit: str
    paper: float
    ours: float | None
    better: Better
    reason: str = "not measured"
    failing: Failing = "both"
    low: float | None = None
    high: float | None = None
    unequal: bool = False
    short: bool = False
    sizes: tuple[float, float] | None = None
    best: Best | None = None

    @property
    def verdict(self) -> str:
        """The verdict in words."""
        if self.better in ("more", "less", "lead"):
            return self._compared()
        if self.better == "point":
            return self._point()
        if self.better == "setting":
            return SAME if self.ours == self.paper else f"{OTHER}: {self.reason}"
        if self.better == "incomparable":
            return f"{INCOMPARABLE}: {self.reason}"
        return self.reason if self.ours is None else ""

    def _compared(self) -> str:
        if self.ours is None:
            theirs = UNEQUAL if self.unequal else CONFIRMED
            prefix = {"ours": f"{WORSE}: ", "theirs": f"{theirs}: ", "both": ""}
            return prefix[self.failing] + self.reason
        if self.better == "lead":
            return self._lead(self.ours)
        if not self._above(self.ours):
            return WORSE
        worst = self.low if self.better == "more" else self.high
        return BETTER if worst is None or self._above(worst) else UNSURE

    def _point(self) -> str:
        if self.short:
            return f"{INCOMPARABLE}: fewer samples than in the paper"
        if self.ours is None:
            return f"{CONTRADICTED}: {self.reason}"
        if self.low is not None and self.high is not None and self.low <= self.paper <= self.high:
            return CONFIRMED
        return EARLIER if self.ours < self.paper else LATER

    def _above(self, ours: float) -> bool:
        return ours >= self.paper if self.better == "more" else ours <= self.paper

    def _lead(self, ours: float) -> str:
        if ours <= 0.0:
            return CONTRADICTED if self.high is not None and self.high < 0.0 else NOT_CONFIRMED
        if self.low is not None and self.low <= 0.0:
            return UNDECIDED
        if self.unequal:
            return UNEQUAL
        if self.short:
            return SHORT
        paper, here = self.sizes or (self.paper, ours)
        found = LARGER if here >= paper else SMALLER
        return f"{found} as a ratio: {here:.2f}, in the paper {paper:.2f}" if self.sizes else found

    def to_json(self) -> dict[str, Any]:
        """JSON values, including the verdict."""
        return {**asdict(self), "verdict": self.verdict}


SETTING = "setting"  # instead of a unit: a number of the configuration
LOSS = "loss"  # instead of a unit: a share small enough to need another digit
_DIGITS = {"%": 1, "s": 2, "ms": 2, "°": 1, LOSS: 4}


def between(low: float, high: float, unit: str) -> str:
    """An interval as text, without its unit."""
    return " to ".join(formatted(one, unit).removesuffix(f"\u00a0{unit}") for one in (low, high))


def formatted(value: float | None, unit: str) -> str:
    """A number with its unit as text."""
    if value is not None and unit in ("samples", "frame"):
        return f"{value:,.0f}"
    if value is not None and unit == SETTING:
        return f"{value:g}"
    text = number(value, _DIGITS.get(unit, 3))
    return text if value is None or unit in ("", LOSS) else f"{text}\u00a0{unit}"
