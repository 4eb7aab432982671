"""Downloads are complete and correct, or fail, whatever the server does."""

from __future__ import annotations

import fcntl
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from peers.fetching import HALF, ONCE, QUICK, in_turn, left, one
from peers.web import CONTENT, ETAG, Request, Script, Server

from kinemimic.pipeline.catalog.download import RetryPolicy
from kinemimic.pipeline.catalog.entry import Catalog
from kinemimic.pipeline.errors import KinemimicError

Serve = Callable[[Script], Server]


def test_an_interrupted_download_is_resumed(catalog: Catalog, tmp_path: Path, serve: Serve) -> None:
    server = serve(in_turn(lambda r: r.cut(HALF), lambda r: r.cut(HALF + 7), Request.whole))
    assert one(catalog, tmp_path / "in", server.base).failures == ()
    assert server.ranges == [None, f"bytes={HALF}-", f"bytes={HALF + 7}-"]
    assert [request.if_range for request in server.asked] == [None, ETAG, ETAG]
    assert left(tmp_path / "in") == {"walks/one.skl": CONTENT}


def test_a_later_call_resumes_too(catalog: Catalog, tmp_path: Path, serve: Serve) -> None:
    server = serve(in_turn(lambda r: r.cut(HALF), Request.whole))
    (failure,) = one(catalog, tmp_path / "in", server.base, ONCE).failures
    assert failure.startswith("walks/one.skl: expected 40,000 bytes from http://127.0.0.1:")
    assert "after 1 attempt: the connection was interrupted; 20,000 bytes are kept" in failure
    assert sorted(left(tmp_path / "in").values()) == sorted([ETAG.encode(), CONTENT[:HALF]])
    assert one(catalog, tmp_path / "in", server.base, ONCE).failures == ()
    assert server.ranges == [None, f"bytes={HALF}-"]
    assert left(tmp_path / "in") == {"walks/one.skl": CONTENT}


@pytest.mark.parametrize("every", [1999, 7777, 13_001])
def test_every_byte_is_sent_once(catalog: Catalog, tmp_path: Path, serve: Serve, every: int) -> None:
    ends = iter(range(every, 10**6, every))
    server = serve(lambda r: r.cut(min(next(ends), len(CONTENT))))
    retry_policy = RetryPolicy(pauses=(0.0,) * 30)
    assert one(catalog, tmp_path / "in", server.base, retry_policy).failures == ()
    assert server.ranges == [None, *(f"bytes={at}-" for at in range(every, len(CONTENT), every))]


def test_a_server_that_ignores_ranges_starts_anew(catalog: Catalog, tmp_path: Path, serve: Serve) -> None:
    def ignoring(request: Request) -> None:
        request.head(200, Content_Length=len(CONTENT))
        request.wfile.write(CONTENT)

    server = serve(in_turn(lambda r: r.cut(HALF), ignoring))
    assert one(catalog, tmp_path / "in", server.base).failures == ()
    assert server.ranges == [None, f"bytes={HALF}-"]
    assert left(tmp_path / "in") == {"walks/one.skl": CONTENT}


def test_a_different_range_restarts_the_download(catalog: Catalog, tmp_path: Path, serve: Serve) -> None:
    def shifted(request: Request) -> None:
        content_range = f"bytes {HALF - 1}-{len(CONTENT) - 1}/{len(CONTENT)}"
        request.head(206, Content_Length=HALF + 1, Content_Range=content_range)
        request.wfile.write(CONTENT[HALF - 1 :])

    server = serve(in_turn(lambda r: r.cut(HALF), shifted, Request.whole))
    assert one(catalog, tmp_path / "in", server.base).failures == ()
    assert server.ranges == [None, f"bytes={HALF}-", None]


@pytest.mark.parametrize("length", [1, HALF, len(CONTENT) - 1, len(CONTENT) + 1, 10**15])
def test_a_wrong_length_is_refused_at_once(
    catalog: Catalog, tmp_path: Path, serve: Serve, length: int
) -> None:
    def lying(request: Request) -> None:
        request.head(200, Content_Length=length)
        request.wfile.write(CONTENT)
        request.close_connection = True

    server = serve(lying)
    (failure,) = one(catalog, tmp_path / "in", server.base).failures
    assert f"expected 40,000 bytes, found {length:,} at http" in failure
    assert len(server.asked) == 1
    assert left(tmp_path / "in") == {}


def test_a_server_that_never_ends_is_cut_off(catalog: Catalog, tmp_path: Path, serve: Serve) -> None:
    sent = [0]

    def endless(request: Request) -> None:
        request.head(200, Connection="close")
        request.close_connection = True
        try:
            while sent[0] < 10**9:
                sent[0] += request.wfile.write(CONTENT)
        except ConnectionError:
            pass

    server = serve(endless)
    (failure,) = one(catalog, tmp_path / "in", server.base).failures
    assert "expected 40,000 bytes, found more at http" in failure
    assert len(server.asked) == 1
    assert sent[0] < 10**8  # what the sockets' buffers took
    assert left(tmp_path / "in") == {}


def test_a_server_that_stalls_is_given_up_and_asked_again(
    catalog: Catalog, tmp_path: Path, serve: Serve
) -> None:
    def stalling(request: Request) -> None:
        request.head(200, Content_Length=len(CONTENT))
        request.wfile.write(CONTENT[:HALF])
        server.over.wait(30)

    server = serve(in_turn(stalling, Request.whole))
    began = time.monotonic()
    assert one(catalog, tmp_path / "in", server.base).failures == ()
    assert time.monotonic() - began < 10
    assert server.ranges == [None, f"bytes={HALF}-"]

    def silent(request: Request) -> None:
        server.over.wait(30)

    server = serve(silent)
    (failure,) = one(catalog, tmp_path / "else", server.base).failures
    assert "after 4 attempts: no data for 0.4 s" in failure
    assert left(tmp_path / "else") == {}


def test_wrong_bytes_are_refused_and_removed(catalog: Catalog, tmp_path: Path, serve: Serve) -> None:
    other = CONTENT[:-1] + b"?"
    server = serve(lambda r: r.whole(other))
    target = tmp_path / "in" / "walks" / "one.skl"
    target.parent.mkdir(parents=True)
    target.write_text("what was there before")
    (failure,) = one(catalog, tmp_path / "in", server.base).failures
    assert failure.startswith("walks/one.skl: expected the file with SHA-256 ")
    assert "\n" not in failure
    assert left(tmp_path / "in") == {"walks/one.skl": b"what was there before"}
    assert one(catalog, tmp_path / "in", serve(Request.whole).base).failures == ()
    assert left(tmp_path / "in") == {"walks/one.skl": CONTENT}


def test_an_unfinished_file_of_wrong_bytes_is_removed_too(
    catalog: Catalog, tmp_path: Path, serve: Serve
) -> None:
    other = b"?" + CONTENT[1:]
    server = serve(in_turn(lambda r: r.cut(HALF, other), Request.whole))
    assert "found a different file of the same size" in one(catalog, tmp_path / "in", server.base).failures[0]
    assert left(tmp_path / "in") == {}


def test_a_server_that_is_busy_is_asked_again_later(
    catalog: Catalog, tmp_path: Path, serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    pauses: list[float] = []
    monkeypatch.setattr("kinemimic.pipeline.catalog.download.time.sleep", pauses.append)
    server = serve(
        in_turn(
            lambda r: r.head(503, Content_Length=0),
            lambda r: r.head(429, Content_Length=0, Retry_After=7),
            lambda r: r.head(500, Content_Length=0, Retry_After=10**5),
            Request.whole,
        )
    )
    assert one(catalog, tmp_path / "in", server.base, RetryPolicy()).failures == ()
    assert pauses == [1.0, 7.0, 60.0]
    server = serve(lambda r: r.head(503, Content_Length=0))
    failure = one(catalog, tmp_path / "b", server.base).failures[0]
    assert "after 4 attempts: the server answered 503" in failure
    assert pauses[3:] == list(QUICK.pauses)


def test_two_at_once_do_not_mix(catalog: Catalog, tmp_path: Path, serve: Serve) -> None:
    server = serve(lambda r: r.cut(HALF))
    one(catalog, tmp_path / "in", server.base, ONCE)
    (partial,) = (tmp_path / "in").rglob("*.part")
    with partial.open("rb") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert "found one running" in one(catalog, tmp_path / "in", server.base).failures[0]
    assert len(server.asked) == 1
    assert partial.read_bytes() == CONTENT[:HALF]


def test_an_unfinished_file_that_is_a_link_is_not_written_through(
    catalog: Catalog, tmp_path: Path, serve: Serve
) -> None:
    one(catalog, tmp_path / "in", serve(lambda r: r.cut(HALF)).base, ONCE)
    (partial,) = (tmp_path / "in").rglob("*.part")
    partial.unlink()
    (tmp_path / "outside").write_text("mine")
    partial.symlink_to(tmp_path / "outside")
    with pytest.raises(OSError, match="symbolic links"):
        one(catalog, tmp_path / "in", serve(Request.whole).base)
    assert (tmp_path / "outside").read_text() == "mine"


@pytest.mark.parametrize(
    ("to", "found"),
    [
        ("file:///etc/passwd", "an address that is not fetched"),
        ("ftp://127.0.0.1/one.skl", "an address that is not fetched"),
        ("http://[::1", "an address that is not fetched"),
        ("/again", "more than 5 redirects"),
    ],
)
def test_a_refused_redirect_is_not_tried_again(
    catalog: Catalog, tmp_path: Path, serve: Serve, to: str, found: str
) -> None:
    server = serve(lambda request: request.head(302, Location=to, Content_Length=0))
    (failure,) = one(catalog, tmp_path / "in", server.base).failures
    assert failure.startswith("walks/one.skl: expected the file at http://127.0.0.1:")
    assert found in failure
    assert "interrupted" not in failure
    assert len(server.asked) == (6 if to == "/again" else 1)
    assert left(tmp_path / "in") == {}


def test_a_password_of_a_mirror_is_not_shown(catalog: Catalog, tmp_path: Path, serve: Serve) -> None:
    answers = (
        lambda r: r.head(404, Content_Length=0),
        lambda r: r.head(503, Content_Length=0),
        lambda r: r.head(302, Location="ftp://me:hush@there/", Content_Length=0),
        lambda r: r.head(200, Content_Length=5),
        lambda r: r.whole(CONTENT[::-1]),
    )
    for answer in answers:
        base = serve(answer).base.replace("://", "://user:hu:s%2Fh@hush@")
        (failure,) = one(catalog, tmp_path / "in", base, ONCE).failures
        assert "http://127.0.0.1:" in failure
        assert "hush" not in failure and "user" not in failure
    for wrong in (
        "ftp://user:hush@there",
        "http://user:hush@",
        "user:hush@there/recordings",
        "http://u:hush@x:y",
    ):
        with pytest.raises(KinemimicError, match="mirror") as caught:
            one(catalog, tmp_path / "in", wrong)
        assert "hush" not in str(caught.value)
