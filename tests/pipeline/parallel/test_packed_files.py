"""Files that travel as bytes arrive unchanged, and never outside their folder."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.validation.bounded import MEGABYTE
from kinemimic.pipeline.parallel import packed_files as module
from kinemimic.pipeline.parallel.packed_files import read_files, read_folder, write_files

FILES = {"a.txt": b"a", "deep/er/b.bin": bytes(range(256)), "empty": b"", ".hidden": b"h", "ümlaut \\": b"u"}


def below(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


def test_a_folder_arrives_as_it_was(tmp_path: Path) -> None:
    write_files(tmp_path / "one", FILES)
    assert read_folder(tmp_path / "one") == FILES
    write_files(tmp_path / "other", read_folder(tmp_path / "one"))
    assert read_folder(tmp_path / "other") == FILES
    write_files(tmp_path / "other", {"a.txt": b"new"})
    assert read_folder(tmp_path / "other") == FILES | {"a.txt": b"new"}


def test_a_name_that_is_not_utf_8_arrives(tmp_path: Path) -> None:
    name = os.fsdecode(b"caf\xe9.skl")
    write_files(tmp_path, {name: b"x"})
    assert os.listdir(os.fsencode(tmp_path)) == [b"caf\xe9.skl"]  # noqa: PTH208 (as bytes)


@pytest.mark.parametrize(
    "name",
    ["../x", "a/../../x", "/x", "//x", "", ".", "..", "a//x", "a/./x", "a/", "a\0b", "x" * 256, "ü" * 128],
)
def test_a_name_outside_the_folder_is_refused_before_anything_is_written(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "in" / "folder"
    with pytest.raises(KinemimicError, match="expected names of files below it from another machine, found"):
        write_files(folder, {"good": b"1", name: b"2"})
    assert below(tmp_path) == set()


@given(st.lists(st.sampled_from(["..", ".", "", "a", "b c", "~", "...", "-"]), min_size=1, max_size=5))
def test_no_name_leads_out(parts: list[str]) -> None:
    """What is not refused is below the folder, by the rules of the system's own paths."""
    name = "/".join(parts)
    try:
        module._require_inside(Path("/nowhere/folder"), name)
    except KinemimicError:
        return
    assert os.path.normpath(f"/nowhere/folder/{name}") == f"/nowhere/folder/{name}"


def test_nothing_is_written_through_a_link(tmp_path: Path) -> None:
    outside, folder = tmp_path / "outside", tmp_path / "folder"
    outside.mkdir()
    (outside / "kept").write_text("kept")
    folder.mkdir()
    (folder / "away").symlink_to(outside)
    (folder / "file").symlink_to(outside / "kept")
    for name in ("away/x", "away/deeper/x", "file", "away"):
        with pytest.raises(KinemimicError, match=r"folder/(away|file): expected .*, found a link"):
            write_files(folder, {name: b"x"})
    assert below(outside) == {"kept"}
    assert (outside / "kept").read_text() == "kept"
    with pytest.raises(KinemimicError, match="folder/away: expected a file, found a link"):
        read_folder(folder)


def test_a_folder_that_is_itself_a_link_is_the_users_choice(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    write_files(tmp_path / "link", {"x": b"1"})
    assert read_folder(tmp_path / "real") == {"x": b"1"}


def test_size_and_number_are_bounded_on_both_ways(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_files(tmp_path / "in", {"a": bytes(MEGABYTE), "b": bytes(MEGABYTE)})
    monkeypatch.setattr(module, "MOST_BYTES", 2 * MEGABYTE - 1)
    with pytest.raises(KinemimicError, match="expected files for another machine, in all of at most"):
        read_folder(tmp_path / "in")
    with pytest.raises(KinemimicError, match="expected at most 1 MB from another machine, found 2"):
        write_files(tmp_path / "out", {"a": bytes(MEGABYTE), "b": bytes(MEGABYTE)})
    monkeypatch.setattr(module, "MOST_FILES", 1)
    with pytest.raises(KinemimicError, match=r"expected at most 1 files .*, found 2"):
        read_files({"a": tmp_path / "in" / "a", "b": tmp_path / "in" / "b"})
    with pytest.raises(KinemimicError, match=r"expected at most 1 files .*, found 2"):
        write_files(tmp_path / "out", {"a": b"", "b": b""})
    assert not (tmp_path / "out").exists()


def test_a_mark_of_completeness_comes_last(tmp_path: Path) -> None:
    """A folder in the way ends the writing before the mark is there, and no temporary file is left."""
    (tmp_path / "z").mkdir()
    with pytest.raises(OSError, match="z"):
        write_files(tmp_path, {"done.json": b"", "a": b"1", "z": b""}, last=lambda name: name == "done.json")
    assert below(tmp_path) == {"a", "z"}


def test_a_pipe_is_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(KinemimicError, match="found a pipe or a device"):
        read_folder(tmp_path)
