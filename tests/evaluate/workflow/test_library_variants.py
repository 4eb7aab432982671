from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinemimic.evaluate.workflow.library_variants import SHARES, Sources, made_variants
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.data_folder import DATASETS
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.library.motion_library import Entry, Split


@pytest.fixture(scope="module")
def walk() -> Motion:
    return read_motion_json(DATASETS / "policies/walk/motion.json")


def entry(name: str, kind: str, motion: Motion, split: Split = "train") -> Entry:
    return Entry(
        name, name, kind, split, float(motion.rate), len(motion.root), motion.cyclic, (0.0, 0.0, 0.0)
    )


def test_every_sort_has_its_share_and_the_rest_are_walks(walk: Motion) -> None:
    counts = Sources([walk], [walk], [walk]).counts(1000)
    assert sum(counts.values()) == 1000
    assert {sort: counts[sort] / 1000 for sort in SHARES} == pytest.approx(SHARES)
    assert counts["walk"] == 1000 - sum(counts[sort] for sort in SHARES)


def test_the_share_of_a_missing_sort_goes_to_the_gaits(walk: Motion) -> None:
    assert Sources([walk], [], []).counts(100) == {"turning": 5, "exercise": 12, "walk": 83}
    assert Sources([], [walk], []).counts(100) == {"run": 88, "exercise": 12}
    with pytest.raises(KinemimicError, match="expected walks or runs to vary, found no loops"):
        Sources([], [], [walk]).counts(100)


def test_only_the_training_part_is_varied(walk: Motion) -> None:
    once = replace(walk, cyclic=False, cycle_offset=np.zeros(3))
    motions = [walk, once, walk]
    entries = [entry("a", "walk", walk), entry("b", "motion", once), entry("c", "walk", walk, "test")]
    sources = Sources.of(motions, entries)
    assert (len(sources.walks), len(sources.runs), len(sources.once)) == (1, 0, 1)
    assert sources.walks[0] is walk


def test_variants_are_named_after_their_sort(walk: Motion, inline: None) -> None:
    made = made_variants([walk], [entry("a", "walk", walk)], 9, 0, 1)
    assert [one.name for _, one in made] == [
        "variants/exercise-00000",
        *(f"variants/walk-0000{k}" for k in range(8)),
    ]
    assert [one.kind for _, one in made[:2]] == ["motion", "walk"]
    assert [one.cyclic for _, one in made[:2]] == [False, True]
