"""run.json: when a stage is up to date."""

from __future__ import annotations

from pathlib import Path

import pytest

from kinemimic.evaluate.workflow import run_record as module
from kinemimic.evaluate.workflow.run_record import RunRecord, stage_inputs
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import read_json, write_json

READS = ("clip",)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A run folder in which the stage `convert` made `out` from `clip`."""
    (tmp_path / "clip").write_text("clip")
    (tmp_path / "out").write_text("out")
    RunRecord(tmp_path).record("convert", source(tmp_path), ["out"])
    return tmp_path


def source(folder: Path, **config: object) -> dict[str, object]:
    return stage_inputs({name: folder / name for name in READS}, config)


def test_a_recorded_stage_is_up_to_date(folder: Path) -> None:
    assert RunRecord(folder).up_to_date("convert", source(folder))


@pytest.mark.parametrize(
    "stages",
    [[], 5, {"convert": 5}, {"convert": {}}, {"convert": {"outputs": 5}}, {"convert": {"outputs": {}}}],
)
def test_an_invalid_entry_is_replaced(folder: Path, stages: object) -> None:
    write_json(folder / "run.json", {"schema": module.RUN_SCHEMA, "stages": stages})
    ledger = RunRecord(folder)
    assert not ledger.up_to_date("convert", source(folder))
    ledger.record("convert", source(folder), ["out"])
    assert RunRecord(folder).up_to_date("convert", source(folder))


def test_another_stage_is_not(folder: Path) -> None:
    assert not RunRecord(folder).up_to_date("retarget", source(folder))


def test_a_changed_input_is_not(folder: Path) -> None:
    (folder / "clip").write_text("another")
    assert not RunRecord(folder).up_to_date("convert", source(folder))


def test_a_removed_input_is_not(folder: Path) -> None:
    (folder / "clip").unlink()
    assert not RunRecord(folder).up_to_date("convert", source(folder))


def test_another_option_is_not(folder: Path) -> None:
    assert not RunRecord(folder).up_to_date("convert", source(folder, filter="none"))


def test_another_version_is_not(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "versions", lambda: {"kinemimic": "99"})
    assert not RunRecord(folder).up_to_date("convert", source(folder))


@pytest.mark.parametrize("damage", [Path.unlink, lambda path: path.write_text("edited")])
def test_an_output_that_is_not_the_recorded_one_is_not(folder: Path, damage: object) -> None:
    assert callable(damage)
    damage(folder / "out")
    assert not RunRecord(folder).up_to_date("convert", source(folder))


def test_the_same_bytes_with_a_new_date_are_up_to_date(folder: Path) -> None:
    (folder / "clip").write_text("clip")
    assert RunRecord(folder).up_to_date("convert", source(folder))


def test_another_schema_counts_as_empty(folder: Path) -> None:
    write_json(folder / "run.json", {**read_json(folder / "run.json"), "schema": 0})
    assert not RunRecord(folder).up_to_date("convert", source(folder))


def test_a_damaged_run_json_is_named(folder: Path) -> None:
    (folder / "run.json").write_text("{")
    with pytest.raises(KinemimicError, match=r"run\.json"):
        RunRecord(folder)


def test_a_file_that_was_not_written_must_stay_absent(folder: Path) -> None:
    RunRecord(folder).record("ingest", source(folder), ["out", "truth"])
    assert RunRecord(folder).up_to_date("ingest", source(folder))
    (folder / "truth").write_text("of another capture")
    assert not RunRecord(folder).up_to_date("ingest", source(folder))


def test_a_record_without_stages_counts_as_empty(folder: Path) -> None:
    write_json(folder / "run.json", {"schema": module.RUN_SCHEMA})
    assert not RunRecord(folder).up_to_date("convert", source(folder))
