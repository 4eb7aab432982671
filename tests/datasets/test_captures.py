"""The catalogue of recordings: complete, and true of the files where they are at hand."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from kinemimic.pipeline.store import file_hash

CATALOGUE = Path(__file__).resolve().parents[2] / "datasets" / "captures.toml"
ENTRIES: list[dict[str, Any]] = tomllib.loads(CATALOGUE.read_text(encoding="utf-8"))["capture"]


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry["name"])
def test_an_entry_says_where_what_and_under_which_licence(entry: dict[str, Any]) -> None:
    fields = {"name", "content", "format", "repository", "commit", "path", "sha256", "licence"}
    assert set(entry) == fields
    assert len(entry["commit"]) == 40
    assert len(entry["sha256"]) == 64


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry["name"])
def test_the_file_is_the_one_that_is_meant(entry: dict[str, Any], captures: Path) -> None:
    assert file_hash(captures / entry["name"]) == entry["sha256"]
