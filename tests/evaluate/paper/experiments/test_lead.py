"""Leads over the same trials, by hand: which trials count as pairs, and what never happens."""

from __future__ import annotations

import numpy as np
import pytest

from kinemimic.evaluate.paper.experiments.lead import _largest, _median, lead, loss, survival_interval
from kinemimic.evaluate.robustness.scenario_trials import Trials, median_time
from kinemimic.train.sim.world import CONTROL_RATE

STEPS = 6


def trials(
    *rows: tuple[float, ...], fallen_at: dict[int, int] | None = None, twins: tuple[int, ...] = ()
) -> Trials:
    """Rewards of each trial, beside twins who earn 1 in every step; twins: the numbers of those who fall."""
    rewards, falls = np.array(rows), np.full(len(rows), STEPS)
    for number, step in (fallen_at or {}).items():
        falls[number] = step
    fell = np.isin(np.arange(len(rows)), twins)
    return Trials(np.zeros(len(rows)), rewards, np.ones_like(rewards), falls, fell)


UNTOUCHED = (1.0,) * STEPS
DIPS = (1.0, 1.0, 0.5, 1.0, 1.0, 1.0)  # from the third step, and is well again after one
LATER = (1.0, 1.0, 0.9, 0.4, 0.9, 1.0)  # and takes three
FALLS = (1.0, 1.0, 0.8, 0.4, 0.0, 0.0)  # two steps after


def test_statistics_of_selections_are_those_of_the_selected_trials() -> None:
    times = np.array([0.3, 0.1, 0.3, 0.7, 0.2])
    chosen = np.random.default_rng(0).integers(3, size=(50, 5), dtype=np.int32)
    chosen[:, 0] += 1
    selected = [np.repeat(np.arange(5), row) for row in chosen]
    assert _median(times, chosen).tolist() == [median_time(times[rows]) for rows in selected]
    gaps = np.random.default_rng(1).normal(size=(5, 4))
    np.testing.assert_allclose(_largest(gaps, chosen), [gaps[rows].mean(axis=0).max() for rows in selected])


def test_the_loss_is_the_means_and_not_the_mean_of_losses() -> None:
    told = loss([trials(DIPS, LATER, UNTOUCHED, FALLS, twins=(3,))])
    # 0.5, 0.1 and 0 in the third step, 0, 0.6 and 0 in the fourth.
    assert (told["share"], told["trials"]) == (pytest.approx(0.2), 3)
    # Resamples reach from three that are untouched to three times 0.6, mirrored at 0.2.
    assert -0.2 <= told["low"] < 0.2 < told["high"] <= 0.4
    assert loss([trials(DIPS, twins=(0,))]) == {"share": None, "low": None, "high": None, "trials": 0}
    assert loss([trials(DIPS)]) == {"share": 0.5, "low": None, "high": None, "trials": 1}


def test_trials_count_in_which_both_stand_by_themselves_and_for_times_both_are_touched() -> None:
    ours = trials(DIPS, DIPS, UNTOUCHED, DIPS)
    theirs = trials(LATER, LATER, LATER, LATER, twins=(3,))
    told = lead([ours], [theirs])
    # Who is not touched loses nothing: of three 2 × 0.5 / 3, against 0.6.
    assert told["loss"]["trials"] == 3
    assert told["loss"]["ahead"] == pytest.approx(0.6 - 1.0 / 3.0, abs=1e-6)
    step, sooner = 1.0 / CONTROL_RATE, told["recovery_s"]
    assert sooner["trials"] == 2
    assert sooner["ours"] == pytest.approx(step, abs=1e-6)
    assert sooner["theirs"] == pytest.approx(3 * step, abs=1e-6)
    assert sooner["ahead"] == pytest.approx(2 * step, abs=1e-6)
    assert told["fall_s"]["ours"] is told["fall_s"]["theirs"] is told["fall_s"]["ahead"] is None


def test_who_falls_later_is_ahead_and_who_never_does_has_no_number() -> None:
    early, late = (1.0, 1.0, 0.5, 0.0, 0.0, 0.0), FALLS
    fell = trials(early, early, fallen_at={0: 3, 1: 3})
    told = lead([trials(late, late, fallen_at={0: 4, 1: 4})], [fell])
    assert told["fall_s"]["ahead"] == pytest.approx(1.0 / CONTROL_RATE, abs=1e-6)
    assert told["recovery_s"]["ahead"] is None
    told = lead([trials(DIPS, DIPS)], [fell])
    assert told["fall_s"]["ours"] is None
    assert told["fall_s"]["theirs"] == pytest.approx(1.0 / CONTROL_RATE, abs=1e-6)
    # For the interval who never falls does so with the trial, four steps after the third.
    assert told["fall_s"]["low"] == pytest.approx(3.0 / CONTROL_RATE, abs=1e-6)


def test_there_is_no_lead_without_a_pair() -> None:
    told = lead([trials(UNTOUCHED)], [trials(DIPS)])
    assert told["recovery_s"]["trials"] == 0
    assert told["recovery_s"]["ahead"] is None
    told = lead([trials(DIPS)], [trials(DIPS, twins=(0,))])
    assert told["loss"] == {"ahead": None, "low": None, "high": None, "trials": 0}


def test_the_interval_of_survival_is_wider_where_seeds_differ() -> None:
    none = trials(*(DIPS,) * 10)
    all_fall = trials(*(FALLS,) * 10, fallen_at=dict.fromkeys(range(10), 4))
    half = trials(*(FALLS,) * 10, fallen_at=dict.fromkeys(range(0, 10, 2), 4))
    low, high = survival_interval([half, half])
    assert 0.2 < low < 0.35 < 0.65 < high < 0.8
    # A third seed could be either: nothing is known.
    assert survival_interval([none, all_fall]) == [0.0, 1.0]
    # Wilson's of 20 of 20, from its formula: 1 / (1 + z² / n).
    assert survival_interval([none, none]) == pytest.approx([1.0 / (1.0 + 1.959964**2 / 20.0), 1.0], abs=1e-5)


def test_all_seeds_count_and_one_that_differs_widens_the_interval() -> None:
    """Two seeds that lose 0.5, two that lose nothing: no resample of trials alone would show both."""
    alike = loss([trials(*(DIPS,) * 8), trials(*(DIPS,) * 8)])
    assert (alike["share"], alike["low"], alike["high"], alike["trials"]) == (0.5, 0.5, 0.5, 16)
    unlike = loss([trials(*(DIPS,) * 8), trials(*(UNTOUCHED,) * 8)])
    assert unlike["share"] == pytest.approx(0.25)
    # Resamples of seeds: both, one twice, the other twice; mirrored at 0.25.
    assert (unlike["low"], unlike["high"]) == (0.0, 0.5)


def test_seed_k_is_compared_with_seed_k_and_a_lone_one_with_all() -> None:
    dips, untouched = trials(DIPS, DIPS), trials(UNTOUCHED, UNTOUCHED)
    assert lead([untouched, dips], [dips, dips])["loss"]["ahead"] == pytest.approx(0.25)
    told = lead([untouched], [dips, dips])["loss"]
    assert (told["ahead"], told["trials"]) == (0.5, 4)
