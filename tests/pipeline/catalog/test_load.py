"""A catalogue is read completely, or refused with a one-line message that locates the mistake."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from peers.web import CONTENT

from kinemimic.pipeline.catalog.entry import HOST, Catalog, collections_of
from kinemimic.pipeline.catalog.load import load_catalog, parse_catalog
from kinemimic.pipeline.errors import KinemimicError

COMMIT = "0123" * 10


def test_a_file_inherits_the_values_of_its_collection(catalog: Catalog) -> None:
    entry = catalog.entry("walks/two.skl")
    assert (entry.bytes, entry.licence, entry.format, entry.frame_rate) == (
        len(CONTENT),
        "free; as air",
        "BVH",
        30,
    )
    assert entry.url == f"{HOST}/some/body/{COMMIT}/a%20folder/two.skl"
    assert entry.url_at("http://here/x/") == f"http://here/x/some/body/{COMMIT}/a%20folder/two.skl"


def test_a_file_may_say_something_else(catalog_file: Path) -> None:
    own = f'repository = "other/place", commit = "{"f" * 40}", format = "none", name = "one.skl"'
    text = catalog_file.read_text().replace('name = "one.skl"', own)
    text = text.replace('name = "two.skl"', 'frame_rate = 0, name = "two.skl"')
    text = text.replace('name = "three.skl"', 'frame_rate = 12.5, format = "C3D", name = "three.skl"')
    first, second, third, _ = parse_catalog(catalog_file, text).entries
    assert first.url == f"{HOST}/other/place/{'f' * 40}/a%20folder/one.skl"
    # The collection's rate is that of recordings.
    assert (first.format, first.frame_rate) == (None, None)
    assert (second.format, second.frame_rate) == ("BVH", None)
    assert (third.format, third.frame_rate) == ("C3D", 12.5)


@pytest.mark.parametrize(
    ("names", "chosen"),
    [
        (["walks"], ["walks/one.skl", "walks/two.skl", "walks/three.skl"]),
        (["runs/one.bvh", "two.skl"], ["walks/two.skl", "runs/one.bvh"]),
        (["*/one.*"], ["walks/one.skl", "runs/one.bvh"]),
        (["r?ns", "runs", "*.bvh"], ["runs/one.bvh"]),
        (["[rw]*"], ["walks/one.skl", "walks/two.skl", "walks/three.skl", "runs/one.bvh"]),
    ],
)
def test_names_and_patterns(catalog: Catalog, names: list[str], chosen: list[str]) -> None:
    assert [entry.name for entry in catalog.select(names)] == chosen


def test_an_unknown_name_suggests_the_nearest(catalog: Catalog) -> None:
    with pytest.raises(KinemimicError, match=r"made\.toml: .* found 'wallks'; did you mean 'walks'\?"):
        catalog.select(["runs", "wallks"])
    with pytest.raises(KinemimicError, match="datasets list"):
        catalog.entry("Xq*")
    assert [one.name for one in collections_of(catalog, catalog.select(["*.bvh"]))] == ["runs"]


# What to put for what, and what the message says; line 16 is the first file of the first collection.
BROKEN = [
    ("schema = 1", "schema = 2", r"key schema: expected 1, found 2"),
    ("schema = 1", "schema = true", r"key schema: expected 1, found True"),
    ("schema = 1", "", r"key schema: expected 1, found none"),
    ("schema = 1", "schema = 1\nsheme = 1", r"key sheme: expected one of schema, collection"),
    ('name = "walks"', 'name = "walks', r"expected TOML, found .*line 5"),
    ('name = "walks"', 'name = "../walks"', r"line 4, key collection\[1\]\.name: .* found '\.\./walks'"),
    ('name = "walks"', 'name = "/etc"', r"line 4, key collection\[1\]\.name"),
    ('name = "walks"', 'name = ".."', r"line 4, key collection\[1\]\.name"),
    ('name = "walks"', "name = 3", r"line 4, key collection\[1\]\.name: .* found 3"),
    ('name = "walks"', 'name = "runs"', r"line 21, key collection\[2\]\.name: .* 'runs' a second time"),
    ('title = "made-up walks"\n', "", r"line 4, key collection\[1\]\.title: .* found none"),
    ('shows = "nothing"', 'shows = "a\\u001b[2J"', r"key collection\[1\]\.shows: expected a line of text"),
    ('shows = "nothing"', 'show = "nothing"', r"key collection\[1\]\.show: .* did you mean 'shows'"),
    ('shows = "nothing"', 'shows = "x"\nlicense = "x"', r"\.license: .*did you mean 'licence'\?"),
    ("frame_rate = 30", "frame_rate = -1", r"frame_rate: expected a number from 0 to"),
    ("frame_rate = 30", "frame_rate = nan", r"frame_rate: expected a number from 0 to"),
    ('"some/body"', '"https://some/body"', r"repository: expected a repository on GitHub, OWNER/NAME"),
    (f'commit = "{COMMIT}"', 'commit = "main"', r"commit: expected a commit, 40 hexadecimal digits"),
    ('name = "one.skl"', 'name = "../../one.skl"', r"line 16, key walks\.files\[1\]\.name: expected a file"),
    ('name = "one.skl"', 'name = "/one.skl"', r"walks\.files\[1\]\.name"),
    ('name = "one.skl"', 'name = ".bashrc"', r"walks\.files\[1\]\.name"),
    ('name = "one.skl"', 'name = "one\\u0000"', r"walks\.files\[1\]\.name"),
    ('name = "one.skl"', 'name = "a\\u202elks.exe"', r"files\[1\]\.name: .* found 'a.u202elks.exe'"),
    ('path = "a folder/one.skl"', 'path = "a\\u2066/one"', r"line 16, key walks\.files\[1\]\.path"),
    ('name = "one.skl"', 'name = "two.skl"', r"walks\.files\[2\]\.name: .* 'two.skl' a second time"),
    ('path = "a folder/one.skl"', 'path = "a/../../one"', r"line 16, key walks\.files\[1\]\.path"),
    ('path = "a folder/one.skl"', 'path = "/one"', r"line 16, key walks\.files\[1\]\.path"),
    ('path = "a folder/one.skl"', 'path = "a//one"', r"line 16, key walks\.files\[1\]\.path"),
    (f"bytes = {len(CONTENT)}", "bytes = 0", r"bytes: expected the file's size in bytes"),
    (f"bytes = {len(CONTENT)}", "bytes = 1e3", r"bytes: expected the file's size in bytes"),
    (f"bytes = {len(CONTENT)}", "bytes = true", r"bytes: expected the file's size in bytes"),
    ('sha256 = "', 'sha256 = "A', r"line 16, key walks\.files\[1\]\.sha256: expected 64 hexadecimal digits"),
    ("[[collection]] # of walks", "[collection]", r"expected TOML"),
    (f"bytes = {len(CONTENT)}", "bytes = 99999999999999999999", r"bytes: expected whole numbers from"),
]  # fmt: skip


@pytest.mark.parametrize(("put", "by", "message"), BROKEN)
def test_a_mistake_is_one_line_with_its_place(catalog_file: Path, put: str, by: str, message: str) -> None:
    text = catalog_file.read_text()
    assert put in text
    catalog_file.write_text(text.replace(put, by, 1))
    with pytest.raises(KinemimicError, match=rf"made\.toml.*{message}") as raised:
        load_catalog(catalog_file)
    assert "\n" not in str(raised.value)


def test_a_long_catalogue_is_read_and_its_last_mistake_found(catalog_file: Path) -> None:
    head = catalog_file.read_text().partition("files = [")[0]
    files = [f'{{ name = "f{k}", path = "p/f{k}", bytes = 1, sha256 = "{k:064d}" }},' for k in range(20_000)]
    text = head + "files = [\n" + "\n".join(files) + "\n]\n"
    (found,) = parse_catalog(catalog_file, text).collections
    assert [one.file for one in found.entries] == [f"f{k}" for k in range(20_000)]
    wrong = text.replace('"p/f19998"', "7").replace('"f19999"', '"f19998"')
    line = text.count("\n") - 2
    with pytest.raises(KinemimicError, match=rf"line {line}, key walks\.files\[19999\]\.path"):
        parse_catalog(catalog_file, wrong)


def test_a_bad_catalogue_is_one_line(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "files").write_text('schema = 1\n[[collection]]\nname = "x"\nfiles = 3')
    for name, message in (
        ("none", "found no file"),
        ("", "found a folder"),
        ("pipe", "found a pipe or a device"),
        ("binary", "expected text in UTF-8"),
    ):
        with pytest.raises(KinemimicError, match=message):
            load_catalog(tmp_path / name)
    with pytest.raises(
        KinemimicError, match=r"line 2, key collection\[1\]\.files: expected 1 to 100,000 files, found 3"
    ):
        load_catalog(tmp_path / "files")


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damage_never_ends_in_a_traceback(catalog_file: Path, data: st.DataObject) -> None:
    text = catalog_file.read_text()
    begin = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(begin, min(len(text), begin + 60)))
    put = data.draw(st.text(st.sampled_from("\"'[]{}=,.#\n 0e-/\\xname\x00é"), max_size=12))
    try:
        catalog = parse_catalog(catalog_file, text[:begin] + put + text[end:])
    except KinemimicError as error:
        assert str(error).startswith(str(catalog_file))
    else:
        for entry in catalog.entries:
            assert Path(entry.name).parts == (entry.collection, entry.file)
            assert ".." not in entry.name.split("/")
