"""Stages of a run folder: all files or none, one command at a time, and nothing made from another capture."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from peers.holding import held_elsewhere

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.stages import STAGES, stage_named, writer_of
from kinemimic.pipeline.run_folder import stage as module
from kinemimic.pipeline.run_folder.record import read_run_record
from kinemimic.pipeline.run_folder.stage import reading, recovered, stage, state_options, up_to_date


def make(run: Path, name: str, text: str = "one", *, files: tuple[str, ...] | None = None) -> None:
    """A stand-in of a stage that writes its files, each with the same text."""
    with stage(run, name) as out:
        for file in files or stage_named(name).writes:
            (out / file).parent.mkdir(parents=True, exist_ok=True)
            (out / file).write_text(text)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A folder after all stages."""
    folder = tmp_path / "run"
    for one in STAGES[1:-1]:
        make(folder, one.name, files=("scenario-room.json",) if one.name == "disturb" else one.writes)
    return folder


def files(run: Path) -> set[str]:
    return {path.name for path in run.iterdir() if path.is_file()}


def test_all_files_appear_at_the_end_or_none(tmp_path: Path) -> None:
    with stage(tmp_path / "run", "ingest") as out:
        (out / "clip.parquet").write_text("a clip")
        assert not (tmp_path / "run" / "clip.parquet").exists()
    assert files(tmp_path / "run") == {"clip.parquet", "run.json"}
    with pytest.raises(ZeroDivisionError), stage(tmp_path / "run", "convert") as out:
        (out / "quaternions.parquet").write_text("half of it")
        raise ZeroDivisionError
    assert files(tmp_path / "run") == {"clip.parquet", "run.json"}
    assert [path.name for path in (tmp_path / "run").iterdir() if path.is_dir()] == []


def test_a_failed_first_stage_leaves_no_folder(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), stage(tmp_path / "run", "ingest"):
        raise ZeroDivisionError
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("file", ["gait_report.json", "index.html"])
def test_a_folder_in_place_of_a_file_is_refused_before_work_begins(run: Path, file: str) -> None:
    (run / file).unlink(missing_ok=True)
    (run / file).mkdir()
    before = (run / "run.json").read_bytes()
    with (
        pytest.raises(KinemimicError, match=f"{file}: expected a file or nothing, found a folder"),
        stage(run, "gait"),
    ):
        pytest.fail("work began")
    assert (run / "run.json").read_bytes() == before
    assert not list(run.glob(".staging*"))


@pytest.mark.parametrize("folder", ["export", "outdated"])
def test_a_file_in_place_of_a_folder_leaves_the_run_folder_as_it_was(run: Path, folder: str) -> None:
    (run / folder).write_text("mine")
    before = {path.name: path.read_bytes() for path in run.iterdir() if path.is_file()}
    with pytest.raises(KinemimicError, match=f"{folder}: expected a folder, found a file"):
        make(run, "export", files=("export/program/walk.txt",))
    assert {path.name: path.read_bytes() for path in run.iterdir() if path.is_file()} == before


def test_a_link_in_place_of_a_file_is_replaced_and_not_followed(run: Path, tmp_path: Path) -> None:
    (elsewhere := tmp_path / "elsewhere").write_text("precious")
    (run / "gait_report.json").unlink()
    (run / "gait_report.json").symlink_to(elsewhere)
    make(run, "gait", "two")
    assert elsewhere.read_text() == "precious"
    assert (run / "gait_report.json").read_text() == "two"


def test_a_later_stage_needs_a_folder(tmp_path: Path) -> None:
    with (
        pytest.raises(KinemimicError, match="expected a run folder, found none"),
        stage(tmp_path / "r", "convert"),
    ):
        pass
    assert not (tmp_path / "r").exists()


def test_what_was_made_from_a_replaced_file_is_set_aside(run: Path, caplog: pytest.LogCaptureFixture) -> None:
    make(run, "train", "another seed")
    gone = {"scores.json", "report.html", "trajectory.npz", "view.rrd", "gait_report.json", "pushes.json"}
    assert not gone & files(run)
    assert gone <= files(run / "outdated" / "1")
    assert {"motion.json", "capture.parquet", "quality.json"} <= files(run)
    assert "set aside what was made from the earlier policy.json, policy.safetensors: " in caplog.text
    make(run, "train", "a third seed")
    assert not (run / "outdated" / "2").exists()


def test_what_was_made_from_a_file_that_a_user_deleted_is_set_aside(
    run: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (run / "policy.json").unlink()
    (run / "policy.safetensors").unlink()
    make(run, "train", "another seed")
    assert "set aside what was made from files that are gone: " in caplog.text


def test_an_equal_file_outdates_nothing(run: Path) -> None:
    before = files(run)
    make(run, "train")
    assert files(run) == before and not (run / "outdated").exists()


def test_files_without_a_record_are_set_aside_too(run: Path) -> None:
    (run / "run.json").unlink()
    make(run, "ingest", "another capture")
    assert files(run) == {"run.json", *stage_named("ingest").writes}
    assert {"motion.json", "policy.safetensors", "scores.json"} <= files(run / "outdated" / "1")


def test_a_file_that_a_stage_no_longer_writes_is_removed(run: Path) -> None:
    make(run, "ingest", files=("raw.parquet", "clip.parquet", "quality.json"))
    assert "truth.parquet" not in files(run)
    # Its stage read the truth, which is no longer there.
    assert "motion.json" not in files(run)


def test_a_stage_that_adds_keeps_its_earlier_files(run: Path) -> None:
    for name in ("a.bvh", "b.trc"):
        with stage(run, "export", adds=True) as out:
            (out / "export").mkdir()
            (out / "export" / name).write_text(name)
    assert files(run / "export") == {"a.bvh", "b.trc"}
    make(run, "retarget", "another motion")
    assert files(run / "export") == set()


@pytest.mark.parametrize(
    ("changed", "by", "mended_by"),
    [
        ("motion.json", "evaluate", "retarget"),
        ("policy.safetensors", "evaluate", "train"),
        ("capture.parquet", "evaluate", "retarget"),
        ("trajectory.npz", "view", "evaluate"),
        ("trajectory.npz", "gait", "evaluate"),
        ("clip.parquet", "convert", "ingest CAPTURE"),
    ],
)
def test_a_file_that_was_replaced_by_hand_is_refused(
    run: Path, changed: str, by: str, mended_by: str
) -> None:
    (run / changed).write_text("of another run")
    with pytest.raises(KinemimicError) as error, stage(run, by):
        pass
    text = str(error.value)
    assert text.startswith(f"{run / changed}: expected the file that ") and "\n" not in text
    assert f"`kinemimic {mended_by} --run {run}`" in text


def test_what_was_made_from_a_file_replaced_by_hand_is_refused(run: Path) -> None:
    record = json.loads((run / "run.json").read_text())
    (run / "motion.json").write_text("of another run")
    record["stages"]["retarget"]["outputs"]["motion.json"] = module.hashes(run, ["motion.json"])[
        "motion.json"
    ]
    (run / "run.json").write_text(json.dumps(record))
    with (
        pytest.raises(KinemimicError, match=r"policy.*expected a file made from the present motion\.json"),
        stage(run, "pushes"),
    ):
        pass


def test_a_deleted_file_further_up_is_no_error(run: Path) -> None:
    for name in ("clip.parquet", "quaternions.parquet", "raw.parquet"):
        (run / name).unlink()
    make(run, "evaluate")


def test_the_record_is_checked(run: Path) -> None:
    whole = (run / "run.json").read_text()
    hostile = json.loads(whole)
    hostile["stages"]["view"]["outputs"] = {"../../etc/passwd": "0"}
    for text, found in (("{", "JSON"), ("[]", "a table"), (json.dumps(hostile), "files of this folder")):
        (run / "run.json").write_text(text)
        with pytest.raises(KinemimicError, match=rf"run\.json.*expected .*{found}"), stage(run, "view"):
            pass
    later = json.loads(whole) | {"schema": 99}
    (run / "run.json").write_text(json.dumps(later))
    with pytest.raises(KinemimicError, match="written by a later version"), stage(run, "view"):
        pass


def test_an_earlier_record_counts_as_empty(run: Path) -> None:
    (run / "run.json").write_text('{"schema": 1, "stages": {"ingest": {}}}')
    assert read_run_record(run).stages == {}


def test_a_stage_is_up_to_date_after_the_same_options_only(run: Path) -> None:
    assert not up_to_date(run, "train", sources={}, options={})  # not run by `run`
    state_options(run, "train", {"seed": 1})
    assert up_to_date(run, "train", sources={}, options={"seed": 1})
    assert not up_to_date(run, "train", sources={}, options={})


@pytest.mark.parametrize("name", ["motion.json", "policy.json"])
@pytest.mark.parametrize("damage", [Path.unlink, lambda path: path.write_text("edited")])
def test_a_stage_is_not_up_to_date_with_another_input_or_output(run: Path, name: str, damage: object) -> None:
    state_options(run, "train", {})
    assert callable(damage)
    damage(run / name)
    assert not up_to_date(run, "train", sources={}, options={})


def test_a_stage_is_not_up_to_date_with_another_source(run: Path, tmp_path: Path) -> None:
    capture = tmp_path / "walk.bvh"
    capture.write_text("a walk")
    with stage(run, "ingest", sources={"walk.bvh": capture}) as out:
        (out / "clip.parquet").write_text("one")
    state_options(run, "ingest", {})
    assert up_to_date(run, "ingest", sources={"walk.bvh": capture}, options={})
    capture.write_text("another")
    assert not up_to_date(run, "ingest", sources={"walk.bvh": capture}, options={})


def test_a_stage_is_not_up_to_date_after_another_version(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    state_options(run, "train", {})
    monkeypatch.setattr(module, "versions", lambda: {"kinemimic": "99"})
    assert not up_to_date(run, "train", sources={}, options={})


def test_a_stage_is_not_up_to_date_while_unfinished(run: Path) -> None:
    with stage(run, "train", unfinished=True) as out:
        (out / "policy.json").write_text("so far")
    state_options(run, "train", {})
    assert not up_to_date(run, "train", sources={}, options={})


@pytest.fixture
def held(run: Path) -> Iterator[Path]:
    """The folder while another process holds it."""
    with held_elsewhere(run):
        yield run


def test_another_process_is_refused(held: Path) -> None:
    for what in (stage, reading):
        with (
            pytest.raises(KinemimicError, match="found one in use by another kinemimic command"),
            what(held, "view"),
        ):
            pass


def test_the_same_process_may_nest_stages(run: Path) -> None:
    with reading(run, "disturb"):
        make(run, "pushes", "again")
    assert (run / "pushes.json").read_text() == "again"


@pytest.mark.parametrize("step", range(6))
def test_a_process_killed_while_files_are_moved(
    run: Path, step: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The next command finishes the move: the result is that of an undisturbed stage."""
    monkeypatch.setattr(module.shutil, "rmtree", lambda *_, **__: None)
    moves = iter(range(100))

    class Killed(BaseException):
        """As if by SIGKILL: nothing is cleaned up."""

    real = Path.replace

    def replace(self: Path, target: Path) -> Path:
        if target.name != "run.json" and next(moves) == step:
            raise Killed
        return real(self, target)

    monkeypatch.setattr(Path, "replace", replace)
    with pytest.raises(Killed):
        make(run, "retarget", "another motion")
    monkeypatch.undo()
    with reading(run, "train"):
        pass
    assert {(run / file).read_text() for file in stage_named("retarget").writes} == {"another motion"}
    assert "policy.safetensors" not in files(run) and "scores.json" not in files(run)
    assert {"policy.safetensors", "scores.json"} <= files(run / "outdated" / "1")
    assert recovered(run).pending is None
    assert not list(run.glob(".staging-*"))


def test_a_command_asked_for_something_keeps_the_files_of_the_plain_one(run: Path) -> None:
    make(run, "view", "all")
    make(run, "view room", files=("view-room.rrd",))
    assert (run / "view.rrd").read_text() == "all"
    assert (run / "view-room.rrd").is_file()


def test_writers_are_named() -> None:
    assert writer_of("scores.json") == "evaluate" and writer_of("other.json") is None
    written = [file for one in STAGES for file in one.writes]
    assert len(written) == len(set(written))


def test_the_page_about_a_folder_stays_as_long_as_what_it_links_to(run: Path) -> None:
    (run / "index.html").write_text("links")
    make(run, "train")
    make(run, "gait")
    assert (run / "index.html").exists()
    make(run, "train", "another")
    assert (run / "outdated").is_dir()
    assert not (run / "index.html").exists()
