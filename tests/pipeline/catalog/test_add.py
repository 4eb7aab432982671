"""Adding files to your own catalogue: measured, recognised, and existing entries unchanged."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner
from peers.films import RATE, film, timed

from kinemimic.pipeline.catalog.add import add, command
from kinemimic.pipeline.catalog.fetch import fetch
from kinemimic.pipeline.catalog.load import load_catalog
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import file_hash
from kinemimic.pipeline.readers.video.container import FORMAT as VIDEO

TOLD = {
    "repository": "my/walks",
    "commit": "ab" * 20,
    "licence": 'CC0 "as is"',
    "citation": "me, today",
}


@pytest.fixture
def walk(tmp_path: Path, bvh: Callable[..., str]) -> Path:
    path = tmp_path / "my walk.bvh"
    path.write_text(bvh(frame_time="0.02"))
    return path


def test_an_added_file_can_be_fetched(tmp_path: Path, walk: Path, skl: Callable[..., str]) -> None:
    mine, second = tmp_path / "mine.toml", tmp_path / "second.skl"
    second.write_text(skl())
    entry, why = add(walk, mine, "home", path="data/my walk.bvh", title="walks at home", **TOLD)
    assert why is None
    assert (entry.name, entry.format) == ("home/my walk.bvh", "BVH")
    assert entry.frame_rate == pytest.approx(50)
    assert (entry.bytes, entry.sha256) == (walk.stat().st_size, file_hash(walk))
    assert entry.url.endswith(f"/my/walks/{'ab' * 20}/data/my%20walk.bvh")
    other, _ = add(second, mine, "home", path="data/second.skl", name="other.skl", commit="cd" * 20)
    assert (other.name, other.format, other.commit) == ("home/other.skl", "Kinect v1 .skl text", "cd" * 20)
    catalog = load_catalog(mine)
    assert set(catalog.entries) == {entry, other}
    (collection,) = catalog.collections
    assert (collection.title, collection.licence, collection.shows) == (
        "walks at home",
        'CC0 "as is"',
        "not stated",
    )
    shelf = tmp_path / "shelf"
    (shelf / "home").mkdir(parents=True)
    (shelf / "home" / "my walk.bvh").write_bytes(walk.read_bytes())
    (shelf / "home" / "other.skl").write_bytes(second.read_bytes())
    assert fetch(catalog.entries, tmp_path / "in", mirror=shelf).failures == ()


def test_comments_and_existing_entries_are_kept(catalog_file: Path, walk: Path) -> None:
    before = catalog_file.read_text()
    known = load_catalog(catalog_file).entries
    entry, _ = add(walk, catalog_file, "walks", path="x.bvh")
    after = catalog_file.read_text()
    added = [line for line in after.splitlines() if line not in before.splitlines()]
    assert len(added) == 1
    assert after.replace(f"{added[0]}\n", "") == before
    assert {*known, entry} == set(load_catalog(catalog_file).entries)
    # 50 Hz, where the collection says 30.
    assert entry.frame_rate == pytest.approx(50)


@pytest.mark.parametrize("files", ["files=[{0}]", "files = [ # all\n{0}\n]", "files = [\n\n  {0} ] # end"])
def test_any_form_of_the_list_takes_one_more(tmp_path: Path, walk: Path, files: str) -> None:
    mine = tmp_path / "mine.toml"
    add(walk, mine, "home", path="x.bvh", **TOLD)
    text = mine.read_text()
    begin, end = text.index("files = ["), text.rindex("]") + 1
    line = text[begin + len("files = [") : end - 1].strip().rstrip(",")
    mine.write_text(text[:begin] + files.format(line).replace("{{", "{"))
    labels = tmp_path / "labels.txt"
    labels.write_text("walk: 1 20\n")
    entry, why = add(labels, mine, "home", path="labels.txt")
    assert (entry.format, entry.frame_rate) == (None, None)
    assert why is not None
    assert why.startswith("unknown format: ")
    assert len(load_catalog(mine).entries) == 2


def test_a_refused_addition_changes_nothing(catalog_file: Path, tmp_path: Path, walk: Path) -> None:
    before = catalog_file.read_bytes()
    same = tmp_path / "same.bvh"
    same.write_bytes(walk.read_bytes())
    mine = tmp_path / "mine.toml"
    add(walk, mine, "home", path="x.bvh", **TOLD)
    kept = mine.read_bytes()
    refused: list[tuple[Callable[[], object], str]] = [
        (lambda: add(walk, mine, "home", path="y.bvh"), "found home/my walk.bvh already in it"),
        (lambda: add(same, mine, "home", path="y.bvh"), "already in it, as home/my walk.bvh"),
        (lambda: add(tmp_path, mine, "home", path="y"), "found a folder"),
        (lambda: add(tmp_path / "none", mine, "home", path="y"), "expected a file, found none"),
        (
            lambda: add(walk, catalog_file, "new", path="y.bvh"),
            "expected --repository for the new collection",
        ),
        (lambda: add(walk, catalog_file, "../new", path="y.bvh", **TOLD), "a folder's name"),
        (lambda: add(walk, catalog_file, "new", path="../y", **TOLD), "a path within the repository"),
        (lambda: add(walk, catalog_file, "walks", path="y", name="a/b"), "a file's name"),
        (lambda: add(walk, catalog_file, "walks", path="y", licence="mine"), "another --collection"),
        (lambda: add(walk, walk, "walks", path="y", **TOLD), "expected TOML"),
    ]
    for adding, match in refused:
        with pytest.raises(KinemimicError, match=match):
            adding()
    assert catalog_file.read_bytes() == before
    assert mine.read_bytes() == kept
    # A form that cannot be extended by a line is refused, not guessed at.
    mine.write_text("schema = 1\ncollection = []\n")
    with pytest.raises(KinemimicError, match="TOML"):
        add(walk, mine, "home", path="x.bvh", **TOLD)


def test_a_video_has_its_format_and_the_rate_of_its_time_stamps(tmp_path: Path) -> None:
    mine, walk = tmp_path / "mine.toml", film(tmp_path / "walk.mp4", 12)
    entry, why = add(walk, mine, "phone", path="walk.mp4", **TOLD)
    assert (entry.format, entry.frame_rate, why) == (VIDEO.name, RATE, None)
    slow = tmp_path / "slow.mp4"
    slow.write_bytes(timed(walk.read_bytes(), [2 / RATE] * 12))
    entry, why = add(slow, mine, "phone", path="slow.mp4")
    assert entry.frame_rate == pytest.approx(RATE / 2, abs=0.01)
    damaged = tmp_path / "damaged.mp4"
    damaged.write_bytes(walk.read_bytes()[:40])
    entry, why = add(damaged, mine, "phone", path="damaged.mp4")
    assert (entry.format, entry.frame_rate) == (VIDEO.name, None)
    assert why is not None and "expected a video that FFmpeg decodes" in why


def test_the_command(tmp_path: Path, walk: Path) -> None:
    mine = tmp_path / "mine.toml"
    options = [f"--{key}={value}" for key, value in TOLD.items()]
    arguments = [str(walk), "--catalog", str(mine), "--collection", "home", "--path", "x.bvh", *options]
    result = CliRunner().invoke(command, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    assert result.stdout.splitlines() == [
        f"{mine}: home/my walk.bvh: BVH, 50 Hz, {walk.stat().st_size:,} bytes",
        f"https://raw.githubusercontent.com/my/walks/{'ab' * 20}/x.bvh",
    ]
    result = CliRunner().invoke(command, [*arguments[:6], "y", "--as", "b", "--json"], catch_exceptions=True)
    assert isinstance(result.exception, KinemimicError)
    other = tmp_path / "note.txt"
    other.write_text("a note")
    arguments = [str(other), *arguments[1:], "--json"]
    record = json.loads(CliRunner().invoke(command, arguments, catch_exceptions=False).stdout)
    assert (record["file"], record["format"], record["bytes"]) == ("note.txt", None, 6)
