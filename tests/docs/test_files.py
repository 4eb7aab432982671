"""files.md lists exactly the keys that the program writes."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from printed.blocks import ROOT
from printed.documented import PAGE, documented_keys

from kinemimic.evaluate.compare.comparison import RESULTS, SHIPPED
from kinemimic.evaluate.policies.recipe import Recipe
from kinemimic.evaluate.robustness.disturb import disturb
from kinemimic.evaluate.robustness.pushes import pushes
from kinemimic.evaluate.scoring.gait_command import gait
from kinemimic.pipeline.catalog.entry import Collection, Entry
from kinemimic.pipeline.convert import convert
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.kinematics.skeleton import NODES
from kinemimic.retarget.versions.params import Capture, Params
from kinemimic.train.scenario.scenario_file import find_scenario

JSON = (
    "quality.json", "gimbal.json", "orientation.json", "motion.json", "gait.json", "policy.json",
    "scores.json", "pushes.json", "scenario-NAME.json", "gait_report.json", "run.json",
)  # fmt: skip
# Constants that are not named after their file.
FILE_OF = {"disturb": "scenario", "captured": "capture", "ledger": "run"}


@pytest.fixture(scope="module")
def run(workshop: Path) -> Path:
    """The workshop's run, with the files of the commands outside `run`."""
    folder = workshop / "runs/walk"
    pushes(folder, phases=1)
    disturb(folder, [find_scenario("slippery")], trials=1)
    gait(folder)
    return folder


@pytest.mark.slow
def test_every_key_of_the_json_files_is_documented_and_written(run: Path) -> None:
    for name in JSON:
        value: Mapping[str, Any] = json.loads((run / name.replace("NAME", "slippery")).read_text())
        assert documented_keys(name) == set(value), name


@pytest.mark.slow
def test_arrays_and_columns_are_documented_and_written(run: Path) -> None:
    with np.load(run / "trajectory.npz") as trajectory:
        assert documented_keys("trajectory.npz") == set(trajectory.files)
    columns = set(pq.read_table(run / "capture.parquet").column_names)
    angles = {"knee_left", "knee_right", "hip_left", "hip_right"}
    plain = {name for name in documented_keys("capture.parquet") if "…" not in name}
    assert columns == plain | {
        prefix + name for prefix in ("adjusted_", "clean_", "truth_") for name in angles
    }
    header = (run / "curves.csv").read_text().splitlines()[0].split(",")
    assert header[:3] == ["frame", "time_s", "reference_knee_left_deg"]


def test_the_columns_and_the_header_of_a_clip_are_documented(tmp_path: Path) -> None:
    ingest(ROOT / "datasets" / "versions" / "raw" / "kinect_walk.skl", tmp_path)
    convert(tmp_path)
    documented = set(re.findall("`([^`]+)`", PAGE.read_text()))
    for name in ("raw", "clip", "quaternions"):
        schema = pq.read_schema(tmp_path / f"{name}.parquet")
        angles = {f"{angle}_deg" for angle in ANGLES}
        nodes = "|".join(sorted(NODES, key=len, reverse=True))
        columns = {"ANGLE_deg" if one in angles else re.sub(nodes, "NODE", one) for one in schema.names}
        assert {one for one in columns if not re.search("_[yz]_m$|_q[yzw]$", one)} <= documented
        header = json.loads(schema.metadata[b"kinemimic"])
        plain = {key.decode() for key in schema.metadata} - {"kinemimic", "ARROW:schema"}
        assert all(f"| `{key}` |" in PAGE.read_text() for key in (*header, *plain))


def test_the_keys_of_a_comparison_are_documented_and_written() -> None:
    assert documented_keys(RESULTS) == set(json.loads((SHIPPED / RESULTS).read_text()))


def test_the_keys_of_hand_written_files_are_those_of_the_code() -> None:
    def keys(kind: Any, *without: str) -> set[str]:
        return {field.name for field in fields(kind)} - set(without)

    params = {f"captures.NAME.{key}" for key in Capture.__struct_encode_fields__} | keys(
        Params, "path", "captures"
    )
    assert documented_keys("params.toml") == params | {"schema"}
    collection = {f"collection.{key}" for key in keys(Collection, "entries")} | {"collection.files"}
    files = {f"files.{key}" for key in keys(Entry, "collection", "file", "licence") | {"name"}}
    assert documented_keys("catalog.toml") == collection | files | {"schema"}
    assert documented_keys("recipes.toml") == set(Recipe.__struct_fields__)


def test_the_numbers_of_the_schemas_are_those_of_the_code() -> None:
    text = PAGE.read_text()
    found = {
        match[1]: int(match[2])
        for path in sorted(
            path
            for folder in ("pipeline", "retarget", "train", "evaluate")
            for path in (ROOT / folder).rglob("*.py")
        )
        for match in re.finditer(r"^(\w+_SCHEMA) = (\d+)$", path.read_text(), re.MULTILINE)
    }
    rows = re.findall(r"^\| (`.*?) \| (\d+) \|", text, re.MULTILINE)
    listed = {name: int(number) for names, number in rows for name in re.findall(r"`(\w+)[.-]", names)}
    for constant, number in found.items():
        stem = constant.removesuffix("_SCHEMA").lower()
        assert number == listed.get(FILE_OF.get(stem, stem), 1), constant
    assert {"policy", "checkpoint", "study", "gait"} <= listed.keys()
