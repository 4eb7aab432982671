"""Provenance: equal runs write equal records."""

from __future__ import annotations

import json
from importlib.metadata import version

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
    assert record["versions"] == versions()
    assert versions()["numpy"] == version("numpy")
