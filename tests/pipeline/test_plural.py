"""Counts with their nouns."""

from __future__ import annotations

import pytest

from kinemimic.pipeline.plural import plural


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ((1, "frame"), "1 frame"),
        ((2, "frame"), "2 frames"),
        ((0, "frame"), "0 frames"),
        ((1, "pass", "passes"), "1 pass"),
        ((3, "person", "people"), "3 people"),
    ],
)
def test_a_count_has_its_noun(words: tuple[int, str], text: str) -> None:
    assert plural(*words) == text
