"""`datasets fetch`: the selection of files, their paths, and the messages about failures."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from urllib.parse import unquote

import pytest
from click.testing import CliRunner
from peers.fetching import HALF, ONCE, QUICK, in_turn, left, one
from peers.web import CONTENT, ETAG, Request, Script, Server
from samples.corpus import published

from kinemimic.pipeline.catalog.entry import Catalog
from kinemimic.pipeline.catalog.fetch import command, fetch
from kinemimic.pipeline.catalog.load import load_catalog
from kinemimic.pipeline.errors import KinemimicError

Serve = Callable[[Script], Server]


def test_files_arrive_under_their_collection(catalog: Catalog, tmp_path: Path, serve: Serve) -> None:
    server = serve(Request.whole)
    fetched = fetch(catalog.entries, tmp_path / "in", mirror=server.base, retry_policy=QUICK)
    assert fetched.failures == ()
    names = ["walks/one.skl", "walks/two.skl", "walks/three.skl", "runs/one.bvh"]
    assert fetched.paths == tuple((tmp_path / "in").resolve() / name for name in names)
    assert left(tmp_path / "in") == dict.fromkeys(sorted(names), CONTENT)
    assert server.asked[0].path == f"/some/body/{'0123' * 10}/a%20folder/one.skl"
    # The connection is kept.
    assert len({request.client for request in server.asked}) == 1
    # A second time nothing is asked for.
    assert fetch(catalog.entries, tmp_path / "in", mirror=server.base) == fetched
    assert len(server.asked) == 4


def test_a_missing_file_does_not_stop_others(catalog: Catalog, tmp_path: Path, serve: Serve) -> None:
    def some(request: Request) -> None:
        if request.path.endswith("two.skl"):
            request.head(404, Content_Length=0)
        else:
            request.whole()

    server = serve(some)
    fetched = fetch(catalog.entries, tmp_path / "in", mirror=server.base, retry_policy=QUICK)
    assert len(fetched.paths) == 3
    (failure,) = fetched.failures
    assert failure.startswith("walks/two.skl: expected the file at http")
    assert failure.endswith("found status 404 Not Found")
    assert len(server.asked) == 4


def test_without_a_connection_no_other_file_is_tried(catalog: Catalog, tmp_path: Path) -> None:
    # Nobody listens at port 9 of this machine; if somebody did, it would be no HTTP.
    fetched = fetch(catalog.entries, tmp_path / "in", mirror="http://127.0.0.1:9", retry_policy=ONCE)
    assert fetched.paths == ()
    assert len(fetched.failures) == 2
    assert fetched.failures[0].endswith("after 1 attempt: no connection")
    assert fetched.failures[1] == "3 more files were not tried, for the same reason"


def test_ctrl_c_loses_nothing(catalog_file: Path, tmp_path: Path, serve: Serve) -> None:
    def stalling(request: Request) -> None:
        request.head(200, Content_Length=len(CONTENT), ETag=ETAG)
        request.wfile.write(CONTENT[:HALF])
        server.over.wait(60)

    server = serve(in_turn(Request.whole, stalling, Request.whole))
    # A job that a shell put into the background hands its children a SIGINT that is ignored.
    code = """
import signal
from kinemimic.pipeline.cli.main import main
signal.signal(signal.SIGINT, signal.default_int_handler)
main()
"""
    options = ("--mirror", server.base, "--into", str(tmp_path / "in"), "--catalog", str(catalog_file))
    process = subprocess.Popen(
        [sys.executable, "-c", code, "datasets", "fetch", "--all", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    ended = time.monotonic() + 60
    while CONTENT[:HALF] not in left(tmp_path / "in").values() and time.monotonic() < ended:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    assert f"interrupted; 1 of 4 files are in {tmp_path / 'in'}; the same command resumes" in err
    assert "Traceback" not in err
    assert out == ""
    assert {name for name in left(tmp_path / "in") if "/." not in name} == {"walks/one.skl"}
    catalog = load_catalog(catalog_file)
    assert fetch(catalog.entries, tmp_path / "in", mirror=server.base).failures == ()
    assert server.ranges == [None, None, f"bytes={HALF}-", None, None]
    assert set(left(tmp_path / "in").values()) == {CONTENT}


@pytest.mark.parametrize("link", ["walks", "walks/one.skl"])
def test_a_link_that_leads_out_is_refused(catalog: Catalog, tmp_path: Path, serve: Serve, link: str) -> None:
    outside, folder = tmp_path / "outside", tmp_path / "in"
    (folder / link).parent.mkdir(parents=True)
    outside.mkdir()
    (folder / link).symlink_to(outside if link == "walks" else outside / "new")
    server = serve(Request.whole)
    (failure,) = one(catalog, folder, server.base).failures
    assert "found a link to" in failure
    assert server.asked == []
    assert list(outside.iterdir()) == []


def test_the_folder_itself_may_be_a_link(catalog: Catalog, tmp_path: Path, serve: Serve) -> None:
    (tmp_path / "disk").mkdir()
    (tmp_path / "in").symlink_to(tmp_path / "disk")
    assert one(catalog, tmp_path / "in", serve(Request.whole).base).failures == ()
    assert left(tmp_path / "disk") == {"walks/one.skl": CONTENT}


def test_a_folder_in_the_place_of_a_file_is_refused(catalog: Catalog, tmp_path: Path, serve: Serve) -> None:
    (tmp_path / "in" / "walks" / "one.skl").mkdir(parents=True)
    assert "found something else" in one(catalog, tmp_path / "in", serve(Request.whole).base).failures[0]


def test_a_mirror_in_a_folder(catalog: Catalog, tmp_path: Path) -> None:
    mirror = tmp_path / "mirror"
    for name, content in (("one", CONTENT), ("two", CONTENT[:-1]), ("three", CONTENT[:-1] + b"?")):
        (mirror / "walks").mkdir(parents=True, exist_ok=True)
        (mirror / "walks" / f"{name}.skl").write_bytes(content)
    fetched = fetch(catalog.entries, tmp_path / "in", mirror=mirror)
    assert left(tmp_path / "in") == {"walks/one.skl": CONTENT}
    assert [failure.split(": ")[0] for failure in fetched.failures] == [
        "walks/two.skl",
        "walks/three.skl",
        "runs/one.bvh",
    ]
    for wrong in ("ftp://here/x", "file:///etc", "http://", str(tmp_path / "none")):
        with pytest.raises(KinemimicError, match="mirror"):
            fetch(catalog.entries, tmp_path / "in", mirror=wrong)


def test_replacing_a_different_file_is_reported(
    catalog_file: Path, catalog: Catalog, tmp_path: Path, serve: Serve
) -> None:
    server, mine = serve(Request.whole), (tmp_path / "in").resolve() / "walks" / "one.skl"
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    options = ["--mirror", server.base, "--catalog", str(catalog_file), "--into", str(tmp_path / "in")]
    result = CliRunner().invoke(command, ["walks", *options], catch_exceptions=False)
    assert result.exit_code == 0 and mine.read_bytes() == CONTENT
    assert result.stderr.splitlines()[1:] == [f"{mine}: replaced a file with other content"]
    assert fetch(catalog.entries, tmp_path / "in", mirror=server.base).replaced == ()


def test_the_command_prints_paths_and_licences_on_stderr(
    catalog_file: Path, tmp_path: Path, serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("KINEMIMIC_CAPTURES", str(tmp_path / "in"))
    server = serve(Request.whole)
    options = ["--mirror", server.base, "--catalog", str(catalog_file)]
    result = CliRunner().invoke(command, ["walks", *options], catch_exceptions=False)
    assert result.exit_code == 0
    assert result.stdout.splitlines() == [
        f"{tmp_path}/in/walks/{name}.skl" for name in ("one", "two", "three")
    ]
    assert result.stderr == "walks: licence: free; as air; from: nobody\n"
    result = CliRunner().invoke(command, ["*.bvh", *options], catch_exceptions=False)
    assert result.stdout == f"{tmp_path}/in/runs/one.bvh\n"
    assert CliRunner().invoke(command, options).exit_code == 2
    assert CliRunner().invoke(command, ["walks", "--all", *options]).exit_code == 2
    # A failure is one line, beside what was fetched.
    (tmp_path / "in" / "walks" / "one.skl").unlink()
    missing = ["--mirror", str(tmp_path), "--catalog", str(catalog_file)]
    result = CliRunner().invoke(command, ["walks", *missing], catch_exceptions=False)
    assert result.exit_code == 2
    assert len(result.stdout.splitlines()) == 2
    assert result.stderr.splitlines()[1].startswith("kinemimic: walks/one.skl: expected 40,000 bytes at ")


def test_every_recording_of_our_catalogue_arrives(captures: Path, tmp_path: Path, serve: Serve) -> None:
    """Over HTTP, from a server that serves the recordings at the URLs of the catalogue."""
    catalog = load_catalog()
    shelf = {f"/{e.repository}/{e.commit}/{e.path}": published(captures, e.name) for e in catalog.entries}
    server = serve(lambda r: r.whole(shelf[unquote(r.path)].read_bytes()))
    began = time.monotonic()
    fetched = fetch(catalog.entries, tmp_path / "in", mirror=server.base)
    print(f"{len(fetched.paths)} files in {time.monotonic() - began:.2f} s")
    assert fetched.failures == ()
    assert len(fetched.paths) == len(catalog.entries) == len(server.asked)
    for entry, path in zip(catalog.entries, fetched.paths, strict=True):
        assert path == (tmp_path / "in").resolve() / entry.collection / entry.file
        assert path.read_bytes() == published(captures, entry.name).read_bytes()
        assert path.stat().st_mode & 0o777 == 0o666 & ~_umask()


def _umask() -> int:
    umask = os.umask(0)
    os.umask(umask)
    return umask
