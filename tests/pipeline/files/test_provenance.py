"""Provenance: equal runs write equal records."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from kinemimic.pipeline.files.provenance import provenance, versions


def test_the_record_does_not_depend_on_the_sequence_of_keys() -> None:
    one = provenance("ingest", inputs={"a": "1", "b": "2"}, config={"x": 1, "y": None}, seed=3)
    two = provenance("ingest", inputs={"b": "2", "a": "1"}, config={"y": None, "x": 1}, seed=3)
    assert json.dumps(one) == json.dumps(two)


def test_the_record_says_what_when_how_and_with_which_versions() -> None:
    record = provenance("train", inputs={"motion": "ab"}, config={"preset": "paper"}, seed=7)
    assert record["stage"] == "train"
    assert record["inputs"] == {"motion": "ab"}
    assert record["config"] == {"preset": "paper"}
    assert record["seed"] == 7


def test_versions_are_those_of_the_packages_that_compute_and_are_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed = {"numpy": "9.1", "torch": "8.2+cpu", "requests": "7.3", "kinemimic": "6.4"}
    for name, release in installed.items():
        folder = tmp_path / f"{name}-{release}.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {release}\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    # requests computes nothing; scipy and pybullet are absent here.
    expected = {name: installed[name] for name in ("kinemimic", "numpy", "torch")}
    assert versions() == expected
    assert provenance("train", inputs={}, config={})["versions"] == expected
