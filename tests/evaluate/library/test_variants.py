from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from peers.trackers import entry, shipped_motion

from kinemimic.evaluate.library.variants import Loops, largest_residual, made_variants
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.feet.zero_moment_point import distance_from_soles
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.library.variants import plausible_variant
from kinemimic.train.reference.residual import residual


@pytest.fixture(scope="module")
def walk() -> Motion:
    return shipped_motion("walk")


def test_every_sort_has_its_share_and_the_rest_are_walks(walk: Motion) -> None:
    counts = Loops([walk], [walk]).counts(1000)
    assert counts == {"turning": 50, "run": 250, "walk": 700}
    assert Loops([walk], []).counts(100) == {"turning": 5, "walk": 95}
    assert Loops([], [walk]).counts(100) == {"run": 100}


def test_without_a_loop_there_are_only_exercises(walk: Motion, inline: None) -> None:
    with pytest.raises(KinemimicError, match="expected walks or runs to vary, found no loops"):
        Loops([], []).counts(100)
    once = replace(walk, cyclic=False, cycle_offset=np.zeros(3))
    made = made_variants([once], [entry("a", "a", "train", once, "motion")], 0, 2, 0, 1)
    assert [one.name for _, one in made] == ["variants/exercise-00000", "variants/exercise-00001"]


def test_only_loops_of_the_training_part_are_varied(walk: Motion) -> None:
    once = replace(walk, cyclic=False, cycle_offset=np.zeros(3))
    motions = [walk, once, walk]
    entries = [
        entry("a", "a", "train", walk),
        entry("b", "b", "train", once),
        entry("c", "c", "test", walk),
    ]
    loops = Loops.of(motions, entries)
    assert (len(loops.walks), len(loops.runs)) == (1, 0)
    assert loops.walks[0] is walk


def test_variants_are_named_after_their_sort(walk: Motion, inline: None) -> None:
    made = made_variants([walk], [entry("a", "a", "train", walk)], 2, 1, 0, 1)
    assert [one.name for _, one in made] == [
        "variants/walk-00000",
        "variants/walk-00001",
        "variants/exercise-00000",
    ]
    assert [(one.kind, one.cyclic) for _, one in made[1:]] == [("walk", True), ("motion", False)]


def test_the_ground_can_carry_a_variant(walk: Motion, inline: None) -> None:
    made = made_variants([walk], [entry("a", "a", "train", walk)], 6, 0, 0, 1)
    for one, _ in made:
        assert residual(one) <= largest_residual("walk", one.cycle_offset[0] / one.duration)


def test_brisk_walks_may_need_more_force_than_slow_ones_and_runs_as_much_at_any_speed() -> None:
    assert largest_residual("walk", 0.5) == largest_residual("walk", 1.2) == 0.25
    assert largest_residual("walk", 2.2) == pytest.approx(0.45)
    assert largest_residual("run", 2.0) == largest_residual("run", 4.0) == 0.65


def test_some_walks_are_balanced_and_the_others_as_they_were_drawn(walk: Motion, inline: None) -> None:
    made = made_variants([walk], [entry("a", "a", "train", walk)], 8, 0, 0, 1)

    def carried(one: Motion, kind: str) -> bool:
        return residual(one) <= largest_residual(kind, one.cycle_offset[0] / one.duration)

    drawn = [plausible_variant([walk], "walk", 0, number, carried) for number in range(8)]
    kept = [one.identity == other.identity for (one, _), other in zip(made, drawn, strict=True)]
    assert 1 <= sum(kept) <= 7
    for (one, _), other, same in zip(made, drawn, kept, strict=True):
        assert same or distance_from_soles(one) < distance_from_soles(other)
        assert (one.cycle_offset == other.cycle_offset).all() and one.duration == other.duration
