"""kinemimic library: captures in, one set of arrays out, split by subject."""

from __future__ import annotations

import gzip
import json
import shutil
from pathlib import Path

import pytest
from peers.recordings import write_damaged, write_walk
from printed.documented import documented_keys

from kinemimic.evaluate.library.command import library
from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.library.library_file import ARRAYS, MANIFEST, read_library


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two walks of one person, one of another, and a damaged capture."""
    folder = tmp_path_factory.mktemp("recordings")
    for name, frames in (("ann_1", 150), ("ann_2", 180), ("bob_1", 150)):
        write_walk(folder / f"{name}.skl", frames)
    write_damaged(folder / "bob_2.bvh")
    return folder


@pytest.fixture
def made(recordings: Path, tmp_path: Path, inline: None) -> Path:
    library([recordings], tmp_path / "library", test=["bob"])
    return tmp_path / "library"


def test_accepted_motions_are_in_the_library(made: Path) -> None:
    found = read_library(made)
    assert [(entry.name, entry.subject, entry.split) for entry in found.entries] == [
        ("ann_1.skl", "ann", "train"),
        ("ann_2.skl", "ann", "train"),
        ("bob_1.skl", "bob", "test"),
    ]
    for index, entry in enumerate(found.entries):
        motion = read_motion_json(made / "runs" / entry.name / "motion.json")
        assert found.motion(index).identity == motion.identity
        assert (entry.kind, entry.cyclic) == ("walk", True)


def test_the_manifest_says_what_went_in_and_what_was_refused(made: Path, recordings: Path) -> None:
    manifest = json.loads((made / MANIFEST).read_text())
    assert manifest["splits"] == {
        "train": {"subjects": ["ann"], "motions": {"walk": 2}},
        "test": {"subjects": ["bob"], "motions": {"walk": 1}},
    }
    assert list(manifest["refused"]) == [str(recordings / "bob_2.bvh")]
    assert manifest["motions"][0]["file"] == str(recordings / "ann_1.skl")
    assert documented_keys("library.json") == set(manifest)


def test_the_same_captures_give_the_same_bytes(made: Path, recordings: Path) -> None:
    before = {name: (made / name).read_bytes() for name in (MANIFEST, ARRAYS)}
    library([recordings], made, test=["bob"])
    assert {name: (made / name).read_bytes() for name in before} == before


def test_variants_of_the_training_part_are_added(recordings: Path, tmp_path: Path, inline: None) -> None:
    manifest = library([recordings], tmp_path / "library", test=["bob"], variants=3, seed=1)
    found = read_library(tmp_path / "library")
    assert manifest["variants"] == {"walk": 3}
    assert [entry.name for entry in found.entries[3:]] == [f"variants/walk-0000{k}" for k in range(3)]
    assert found.subjects("test") == {"bob"}
    assert found.subjects("train") == {"ann", "variants"}
    again = library([recordings], tmp_path / "again", test=["bob"], variants=3, seed=1)
    other = library([recordings], tmp_path / "other", test=["bob"], variants=3, seed=2)
    assert again["sha256"] == manifest["sha256"] != other["sha256"]


def _failure(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    with pytest.raises(SystemExit) as exit_:
        main(["library", *map(str, arguments)])
    assert exit_.value.code == 2
    return capsys.readouterr().err


def test_the_command_prints_a_line_for_each_subject(recordings, tmp_path, inline, capsys) -> None:
    out = tmp_path / "library"
    with pytest.raises(SystemExit) as exit_:
        main(["library", str(recordings), "--out", str(out), "--subject", "(.*)_1|.*"])
    assert exit_.value.code == 2  # ann_2 matches without the group
    capsys.readouterr()
    main_arguments = ["library", str(recordings), "--out", str(out), "--test", "ann", "-j", "1"]
    with pytest.raises(SystemExit) as exit_:
        main(main_arguments)
    assert exit_.value.code == 0
    text = capsys.readouterr().out
    assert [line.split()[:4] for line in text.splitlines()[1:3]] == [
        ["ann", "test", "2", "2"],
        ["bob", "train", "1", "1"],
    ]
    assert "bob_2.bvh: " in text


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--test", "eve"], "expected subjects of the captures (ann, bob), found 'eve'"),
        (["--subject", "("], "expected a regular expression, found '('"),
        (["--subject", r"\d+"], "finds a person in every file's name, found none in"),
    ],
)
def test_a_wrong_option_writes_no_library(recordings, tmp_path, inline, capsys, options, message) -> None:
    assert message in _failure(capsys, recordings, "--out", tmp_path / "library", *options)
    assert not (tmp_path / "library").exists()  # no capture is processed


def test_the_subject_of_a_compressed_capture_is_that_of_the_capture(tmp_path: Path, inline: None) -> None:
    walk = write_walk(tmp_path / "ann.skl")
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "ann.skl.gz").write_bytes(gzip.compress(walk.read_bytes()))
    (tmp_path / "in" / "notes.md").write_text("# Recorded in May\n")
    manifest = library([tmp_path / "in"], tmp_path / "library", subject="ann$", jobs=1)
    assert manifest["splits"]["train"]["subjects"] == ["ann"]
    with pytest.raises(KinemimicError, match=r"subjects of the captures \(ann\), found 'notes'"):
        library([tmp_path / "in"], tmp_path / "library", test=["notes"])


def test_without_an_accepted_motion_there_is_no_library(tmp_path: Path, inline: None) -> None:
    capture = write_damaged(tmp_path / "recordings" / "ann.bvh")
    with pytest.raises(KinemimicError, match="expected at least one accepted motion, found 1 capture"):
        library([capture.parent], tmp_path / "library")
    with pytest.raises(KinemimicError, match="expected captures, found none"):
        library([tmp_path / "library"], tmp_path / "other")


def test_an_unknown_subject_is_told_the_captures_alone(recordings: Path, tmp_path: Path) -> None:
    folder = tmp_path / "captures"
    shutil.copytree(recordings, folder)
    (folder / "note.txt").write_text("bought on Monday")
    with pytest.raises(KinemimicError, match="subjects of the captures") as caught:
        library([folder], tmp_path / "out", test=["nobody"])
    assert "note" not in str(caught.value)
    assert not (tmp_path / "out").exists()
