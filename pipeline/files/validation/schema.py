"""Schema versions of files: upgrade older files step by step, refuse newer ones with advice.

A file states its schema, an integer that rises by one with every change that an older reader would
misunderstand. A file without a schema number counts as 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import KinemimicError

# Converts a document of one schema to the next.
Upgrade = Callable[[Mapping[str, Any]], Mapping[str, Any]]


def unchanged(document: Mapping[str, Any]) -> Mapping[str, Any]:
    """The upgrade of a document that lacks only the schema number."""
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
    """The document upgraded to `schema`.

    kind: description of the file in errors; upgrades: schema -> upgrade to the next one; advice: what the
    user can do if a step is missing. KinemimicError in that case, and for a file of a later version.
    """
    found = document.get("schema", 0)
    if type(found) is not int or found < 0:
        raise KinemimicError(f"{path}: expected {kind} of schema {schema}, found {found!r:.40}; {advice}")
    if found > schema:
        raise KinemimicError(
            f"{path}: expected {kind} of schema {schema}, found {found}, written by a later version "
            f"of kinemimic; install that version, or {advice}"
        )
    result = dict(document)
    for step in range(found, schema):
        if step not in (upgrades or {}):
            shown = "none" if found == 0 else str(found)
            raise KinemimicError(f"{path}: expected {kind} of schema {schema}, found {shown}; {advice}")
        result = {**(upgrades or {})[step](result), "schema": step + 1}
    return result
