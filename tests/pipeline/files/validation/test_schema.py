"""Schema versions: older files are upgraded step by step; newer and invalid ones are refused with advice."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.validation.schema import Upgrade, unchanged, upgraded

PATH = Path("runs/walk/thing.json")


def take(document: Mapping[str, Any], upgrades: Mapping[int, Upgrade] | None = None) -> dict[str, Any]:
    return upgraded(document, PATH, kind="a thing", schema=3, advice="make it again", upgrades=upgrades)


def in_metres(document: Mapping[str, Any]) -> Mapping[str, Any]:
    return {**document, "length": document["length"] / 100}


def renamed(document: Mapping[str, Any]) -> Mapping[str, Any]:
    return {"metres" if key == "length" else key: value for key, value in document.items()}


STEPS: Mapping[int, Upgrade] = {0: unchanged, 1: in_metres, 2: renamed}


@pytest.mark.parametrize(
    "document",
    [
        {"length": 180},
        {"schema": 1, "length": 180},
        {"schema": 2, "length": 1.8},
        {"schema": 3, "metres": 1.8},
    ],
)
def test_every_older_one_comes_to_the_same(document: Mapping[str, Any]) -> None:
    before = dict(document)
    assert take(document, STEPS) == {"schema": 3, "metres": 1.8}
    assert document == before


@pytest.mark.parametrize(
    ("document", "told"),
    [
        (
            {"schema": 4},
            "found 4, written by a later version of kinemimic; install that version, or make it again",
        ),
        ({"schema": 1}, "found 1; make it again"),
        ({}, "found none; make it again"),
        ({"schema": "3"}, "found '3'; make it again"),
        ({"schema": True}, "found True; make it again"),
        ({"schema": -1}, "found -1; make it again"),
    ],
)
def test_what_there_is_no_way_from_is_one_line(document: Mapping[str, Any], told: str) -> None:
    with pytest.raises(KinemimicError) as caught:
        take(document, {2: renamed})
    assert str(caught.value) == f"{PATH}: expected a thing of schema 3, {told}"
