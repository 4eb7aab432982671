"""Tracking states from a column of marks or confidences: missing, inferred or tracked."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Mask
from kinemimic.pipeline.readers.custom_table.description import States
from kinemimic.pipeline.readers.custom_table.table import Words

Codes = NDArray[np.uint8]


def states_are_words(marks: States) -> bool:
    """Whether the description lists states that are words, so that their columns are read as text."""
    return any(isinstance(mark, str) for state in marks.marks for mark in state)


def states_of_numbers(written: NDArray[np.float64], marks: States) -> tuple[Mask, Codes]:
    """For each number, whether it denotes a state, and which (0, 1, 2); NaN means missing."""
    if marks.tracked_from is not None:
        # A comparison with NaN is False, which gives 0.
        codes = (written >= marks.inferred_from).astype(np.uint8) + (written >= marks.tracked_from)
        return np.ones(len(written), dtype=np.bool_), codes.astype(np.uint8)
    listed = [
        np.isin(written, [mark for mark in state if not isinstance(mark, str)]) for state in marks.marks
    ]
    return _coded(np.isnan(written), listed)


def states_of_words(written: Words, marks: States) -> tuple[Mask, Codes]:
    """For each word, whether it denotes a state, and which (0, 1, 2); an empty cell means missing."""
    listed = [
        np.isin(written.known, [mark if isinstance(mark, str) else f"{mark:g}" for mark in state])
        for state in marks.marks
    ]
    known, codes = _coded(np.array([not word for word in written.known]), listed)
    return known[written.codes], codes[written.codes]


def _coded(empty: Mask, listed: list[Mask]) -> tuple[Mask, Codes]:
    missing, inferred, tracked = listed
    codes = np.where(tracked, 2, np.where(inferred, 1, 0)).astype(np.uint8)
    return empty | missing | inferred | tracked, codes
