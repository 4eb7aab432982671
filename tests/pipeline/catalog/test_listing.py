"""The list: every collection, or one with its files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from peers.web import CONTENT

from kinemimic.pipeline.catalog.listing import command
from kinemimic.pipeline.catalog.load import load_catalog
from kinemimic.pipeline.catalog.local_files import captures_folder
from kinemimic.pipeline.cli.main import main


def listed(*arguments: str) -> str:
    result = CliRunner().invoke(command, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    return result.stdout


def test_all_of_ours_fits_a_terminal(tmp_path: Path) -> None:
    text = listed("--in", str(tmp_path))
    for collection in load_catalog().collections:
        assert any(line.startswith(f"{collection.name} ") for line in text.splitlines())
    assert max(map(len, text.splitlines())) <= 100 + len(str(tmp_path))
    assert f"29 collections, 240 files, 67.3 MB; 0 of the files in {tmp_path}" in text


def test_local_files_are_counted(catalog_file: Path, tmp_path: Path) -> None:
    here = ("--in", str(tmp_path), "--catalog", str(catalog_file))
    (tmp_path / "walks").mkdir()
    (tmp_path / "walks" / "one.skl").write_bytes(CONTENT)
    assert f"2 collections, 4 files, 160.0 kB; 1 of the files in {tmp_path}" in listed(*here)
    rows = [line.split() for line in listed("*", *here).splitlines()]
    assert ["walks", "none", "BVH", "3", "0.1", "30", "1", "free", "…"] in rows
    assert ["runs", "none", "BVH", "1", "0.0", "30", "-", "free", "…"] in rows


def test_one_collection_is_listed_in_full(catalog_file: Path, tmp_path: Path) -> None:
    here = ("--in", str(tmp_path), "--catalog", str(catalog_file))
    text = listed("walks", *here)
    for part in (
        "made-up walks",
        "free; as air",
        "nobody",
        "https://github.com/some/body/tree/0123",
        "two.skl",
    ):
        assert part in text
    one = listed("two.skl", *here)
    assert "/a%20folder/two.skl" in one
    assert "three.skl" not in one


def test_json_has_every_url(catalog_file: Path, tmp_path: Path) -> None:
    walks, runs = json.loads(listed("--json", "--in", str(tmp_path), "--catalog", str(catalog_file)))
    assert walks["licence"] == "free; as air"
    assert [file["name"] for file in walks["files"]] == ["one.skl", "two.skl", "three.skl"]
    assert runs["files"][0]["url"].endswith("/a%20folder/one.bvh")
    assert runs["files"][0]["here"] is False


def test_the_folder_of_recordings_by_precedence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("KINEMIMIC_CAPTURES", raising=False)
    assert captures_folder() == tmp_path / "kinemimic" / "captures"
    monkeypatch.setenv("KINEMIMIC_CAPTURES", "there")
    assert captures_folder() == Path("there")
    assert captures_folder(tmp_path) == tmp_path


def test_an_unknown_name_is_told_the_collections(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["datasets", "list", "nosuch"])
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("kinemimic: expected a collection (kinect1_bernstein_skl, ")
