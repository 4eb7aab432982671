"""Both engines come to the same push table, and a fifth more force on one of them shows.

Each phase and direction is a pair: the same figure, pushed alike on either engine. It goes the same way but
for rounding, a micrometre after seconds, so that chance decides what is at the very border of a fall alone.
A pair tells on which engine the figure survives more of the table's pushes, if on either. Between engines
that differ by chance, either is as likely the one: a sign test, exact for few pairs, which assumes nothing
of how the pushes of a pair hang together. Cell by cell it would take dozens of phases to see what the pairs
show with four, for almost any share agrees with the interval of one of four trials.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binomtest

from kinemimic.evaluate.policies.recipe import POLICIES
from kinemimic.evaluate.robustness import push_trials
from kinemimic.evaluate.robustness.push_trials import DIRECTIONS, PushTask, push_from_all_directions
from kinemimic.train.config.config import TrainConfig
from kinemimic.train.rollout.policy import load_trained

# N, around what the shipped walk survives, each a fifth more than the one before: whose pushes are a fifth
# harder survives one fewer of them.
GRID = tuple(55.0 * 1.2**k for k in range(6))
# Of the first half of the cycle: in the second the pushes of one side mirror those of the other.
PHASES = (0.06, 0.18, 0.31, 0.43)
SURE = 0.01  # what chance does more rarely is no chance


def survivals(engine: str, monkeypatch: pytest.MonkeyPatch, harder: float = 1.0) -> NDArray[np.int64]:
    """How many pushes of the grid, so many times as hard, each phase and direction survives: (P, 4)."""
    motion, policy, record = load_trained(POLICIES / "walk")
    config = TrainConfig.from_json(record["config"]).env
    with monkeypatch.context() as patched:
        patched.setattr(push_trials, "GRID", tuple(harder * force for force in GRID))
        patched.setattr(push_trials, "EXTENDED_GRID", ())
        patched.setattr(push_trials, "RESOLUTION", float("inf"))  # no search between the grid's forces
        found = [
            push_from_all_directions(PushTask(motion, policy, config, phase, engine)) for phase in PHASES
        ]
    assert all(one.survived_unpushed for phase in found for one in phase)
    return np.array([[sum(one.grid) for one in phase] for phase in found])


def chance(one: NDArray[np.int64], other: NDArray[np.int64]) -> float:
    """How likely so one-sided a difference is if the engines differ by chance alone: two-sided sign test."""
    more, fewer = int((one > other).sum()), int((one < other).sum())
    return float(binomtest(more, more + fewer).pvalue) if more + fewer else 1.0


def test_the_sign_test_by_hand() -> None:
    """Of 8 pairs two are alike; 6 of 6 to one side: 2 / 2⁶. 5 of 6: 2 (1 + 6) / 2⁶."""
    zeros, ones = np.zeros(8, dtype=np.int64), np.array([1, 2, 1, 1, 3, 1, 0, 0])
    assert chance(zeros, zeros) == 1.0
    assert chance(ones, zeros) == chance(zeros, ones) == pytest.approx(2 / 64)
    ones[0] = -1
    assert chance(ones, zeros) == pytest.approx(14 / 64)


@pytest.mark.slow
def test_engines_agree_on_a_push_table(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("kinemimic_native", reason="the native engine is not built here")
    bullet, native = (survivals(engine, monkeypatch) for engine in ("pybullet", "native"))
    # The grid's forces fell some and not others: the table says something.
    assert (bullet.sum(axis=0) > 0).all()
    assert (bullet.sum(axis=0) < len(PHASES) * len(GRID)).all()
    assert bullet.shape == (len(PHASES), len(DIRECTIONS))
    assert chance(native, bullet) > SURE
    harder = survivals("native", monkeypatch, 1.2)
    assert chance(harder, bullet) < SURE
