"""`datasets verify`: every file is right, wrong, missing or unknown; the exit status agrees."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from peers.web import CONTENT

from kinemimic.pipeline.catalog.entry import Catalog
from kinemimic.pipeline.catalog.verify import command, verify
from kinemimic.pipeline.errors import KinemimicError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """One correct file, one too short, one with other content; a missing collection; unknown files."""
    here = tmp_path / "in"
    (here / "walks").mkdir(parents=True)
    (here / "walks" / "one.skl").write_bytes(CONTENT)
    (here / "walks" / "two.skl").write_bytes(CONTENT[:-1])
    (here / "walks" / "three.skl").write_bytes(CONTENT[:-1] + b"?")
    (here / "walks" / ".four.skl.01234567.part").write_bytes(b"x")
    (here / "walks" / "five.skl").write_bytes(b"x")
    (here / "jumps").mkdir()
    (here / "notes.txt").write_text("x")
    return here


def test_right_wrong_missing_and_unknown_files(catalog: Catalog, folder: Path) -> None:
    found = verify(catalog, catalog.entries, folder)
    assert found.right == ("walks/one.skl",)
    assert found.wrong["walks/two.skl"] == "expected 40,000 bytes, found 39,999"
    assert found.wrong["walks/three.skl"].startswith("expected SHA-256 ")
    assert len(found.wrong) == 2
    assert found.missing == ("runs/one.bvh",)
    assert found.unknown == ("walks/five.skl", "jumps/", "notes.txt")
    # Of some only what lies beside them.
    some = verify(catalog, catalog.select(["walks/one.skl"]), folder)
    assert (some.right, some.wrong, some.missing, some.unknown) == (found.right, {}, (), ("walks/five.skl",))
    with pytest.raises(KinemimicError, match="datasets fetch"):
        verify(catalog, catalog.entries, folder / "none")


def test_missing_files_given_by_name_set_the_exit_status(catalog_file: Path, folder: Path) -> None:
    def status(*names: str) -> int:
        options = ["--in", str(folder), "--catalog", str(catalog_file)]
        return CliRunner().invoke(command, [*names, *options], catch_exceptions=False).exit_code

    assert status() == status("--all") == status("walks") == status("runs") == 1
    assert status("one.skl") == 0
    (folder / "walks" / "two.skl").unlink()
    (folder / "walks" / "three.skl").write_bytes(CONTENT)
    assert status() == 0
    assert status("--all") == status("walks") == status("runs") == 1
    assert status("walks", "--all") == 2


def test_the_command_tells_it_in_lines_and_in_json(catalog_file: Path, folder: Path) -> None:
    options = ["--in", str(folder), "--catalog", str(catalog_file)]
    out = CliRunner().invoke(command, options).stdout
    assert "wrong    walks/two.skl: expected 40,000 bytes, found 39,999\n" in out
    assert "missing  runs/one.bvh\n" in out
    assert out.endswith("in: 1 right, 2 wrong, 1 missing, 3 unknown to the catalogue\n")
    result = json.loads(CliRunner().invoke(command, [*options, "--json"]).stdout)
    assert result["right"] == ["walks/one.skl"]
    assert set(result["wrong"]) == {"walks/two.skl", "walks/three.skl"}
    for path in (folder / "walks").iterdir():
        path.unlink()
    assert "missing  walks (all 3 files)\n" in CliRunner().invoke(command, options).stdout
