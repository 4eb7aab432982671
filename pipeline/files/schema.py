"""Versions of files: an older one is taken over step by step, a later or a strange one is told what to do.

A file says its schema, a whole number that rises by one when a reader of before would misunderstand it. One
of before there were such numbers counts as 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import KinemimicError

# From a document of one schema to that of the next.
Upgrade = Callable[[Mapping[str, Any]], Mapping[str, Any]]


def unchanged(document: Mapping[str, Any]) -> Mapping[str, Any]:
    """The upgrade of what only lacks its number."""
    return document


def upgraded(
    document: Mapping[str, Any],
    path: Path,
    *,
    kind: str,
    schema: int,
    advice: str,
    upgrades: Mapping[int, Upgrade] | None = None,
) -> dict[str, Any]:
    """A document as `schema` has it.

    kind: what the file holds, for people; upgrades: schema -> how to come to the next; advice: what to do
    with a file that there is no way from. KinemimicError if there is none, or the file is a later version's.
    """
    found = document.get("schema", 0)
    if type(found) is not int or found < 0:
        raise KinemimicError(f"{path}: expected {kind} of schema {schema}, found {found!r:.40}; {advice}")
    if found > schema:
        raise KinemimicError(
            f"{path}: expected {kind} of schema {schema}, found {found}, which a later version of kinemimic "
            f"wrote; install that, or {advice}"
        )
    result = dict(document)
    for step in range(found, schema):
        if step not in (upgrades or {}):
            told = "none" if found == 0 else str(found)
            raise KinemimicError(f"{path}: expected {kind} of schema {schema}, found {told}; {advice}")
        result = {**(upgrades or {})[step](result), "schema": step + 1}
    return result
