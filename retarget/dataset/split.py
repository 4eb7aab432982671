"""The person of a capture, and the split of a person.

A split is drawn by the hash of the person's name: it does not depend on which other captures there are, so a
data set that grows moves nobody from one split to another, and no person is in two.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import PurePosixPath

from kinemimic.pipeline.errors import KinemimicError

SUBJECT = r"[^_]+"
SPLITS = ("train", "validation", "test")
_SHARES = (0.8, 0.1, 0.1)


def subject_pattern(text: str | None) -> re.Pattern[str]:
    """The compiled expression, by default SUBJECT; KinemimicError if it is invalid."""
    try:
        return re.compile(SUBJECT if text is None else text)
    except re.error as error:
        raise KinemimicError(f"--subject: expected a regular expression, found {text!r}: {error}") from None


def subject_of(name: str, pattern: re.Pattern[str]) -> str:
    """The person in a capture's file name without ending, from its beginning: the first group, or all that
    matches; the whole name without a match, so that such a capture is a person of its own."""
    return subject_in(name, pattern) or _stem(name)


def subject_in(name: str, pattern: re.Pattern[str]) -> str | None:
    """As `subject_of`; None without a match, and for one of nothing."""
    found = pattern.match(_stem(name))
    return (found and (found[1] if pattern.groups else found[0])) or None


def _stem(name: str) -> str:
    stem = PurePosixPath(name).name.removesuffix(".gz")
    return stem.rpartition(".")[0] or stem


def split_of(subject: str) -> str:
    """One of SPLITS: 80, 10 and 10 % of all names."""
    place = int.from_bytes(hashlib.sha256(subject.encode("utf-8", "surrogateescape")).digest()[:8]) / 2**64
    bound = 0.0
    for split, share in zip(SPLITS, _SHARES, strict=True):
        bound += share
        if place < bound:
            return split
    return SPLITS[-1]
