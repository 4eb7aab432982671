"""Who may open the page, tried with requests and WebSockets of every kind."""

from __future__ import annotations

import http.client
from collections.abc import Iterator
from pathlib import Path

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from kinemimic.evaluate.simulate.page.controls import Choices
from kinemimic.evaluate.simulate.page.guard import MAX_CONNECTIONS
from kinemimic.evaluate.simulate.page.page import Page

viser = pytest.importorskip("viser")
TOKEN = "a-token-of-a-test"
PROTOCOL = [Subprotocol(f"viser-v{viser.__version__}")]


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    page = Page(18_090, TOKEN, Choices(("walk",), ("walk",), (), "walk", "walk"))
    yield page
    page.close()


@pytest.fixture(scope="module")
def port(page: Page) -> int:
    return int(page.address.split(":")[2].split("/")[0])


def get(port: int, path: str, **headers: str) -> tuple[int, str, dict[str, str]]:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    found = answer.status, answer.read().decode(errors="replace"), dict(answer.getheaders())
    connection.close()
    return found


def test_the_address_opens_the_page_and_leaves_a_cookie(port: int) -> None:
    status, text, headers = get(port, f"/?token={TOKEN}")
    assert status == 200
    assert "<html" in text
    assert headers["Set-Cookie"] == f"kinemimic-{port}={TOKEN}; HttpOnly; SameSite=Strict; Path=/"
    assert get(port, "/", Cookie=f"kinemimic-{port}={TOKEN}")[0] == 200


@pytest.mark.parametrize(
    ("path", "headers", "why"),
    [
        ("/", {}, "no token"),
        ("/?token=", {}, "no token"),
        ("/?token=another", {}, "no token"),
        ("/?token=%C3%A9", {}, "no token"),
        ("/", {"Cookie": "kinemimic-1=" + TOKEN}, "no token"),
        ("/", {"Cookie": "=;;; ="}, "no token"),
        (f"/?token={TOKEN}", {"Host": "evil.example"}, "another host"),
        (f"/?token={TOKEN}", {"Origin": "http://evil.example"}, "another origin"),
    ],
)
def test_others_are_refused(port: int, path: str, headers: dict[str, str], why: str) -> None:
    status, text, found = get(port, path, **headers)
    assert (status, "Set-Cookie" in found) == (403, False)
    assert why in text


@pytest.mark.parametrize(
    ("origin", "token"),
    [("http://127.0.0.1:{}", "wrong"), ("http://evil.example", TOKEN), (None, TOKEN)],
)
def test_a_socket_needs_token_and_origin(port: int, origin: str | None, token: str) -> None:
    own = None if origin is None else Origin(origin.format(port))
    with pytest.raises(InvalidStatus) as found:
        connect(f"ws://127.0.0.1:{port}/?token={token}", origin=own, subprotocols=PROTOCOL)
    assert found.value.response.status_code == 403


def test_at_most_so_many_viewers_and_junk_harms_nobody(page: Page, port: int) -> None:
    address, origin = f"ws://127.0.0.1:{port}/?token={TOKEN}", Origin(f"http://127.0.0.1:{port}")
    sockets = [connect(address, origin=origin, subprotocols=PROTOCOL) for _ in range(MAX_CONNECTIONS)]
    with pytest.raises(InvalidStatus):
        connect(address, origin=origin, subprotocols=PROTOCOL)
    sockets[0].send(b"\x00\xffno message")
    sockets[1].send("{" * 1000)
    sockets[2].send(b"x" * (1 << 21))
    for socket in sockets:
        socket.close()
    assert get(port, f"/?token={TOKEN}")[0] == 200
    with connect(address, origin=origin, subprotocols=PROTOCOL) as socket:
        assert socket.recv(timeout=10)


def test_it_listens_on_this_machine_alone(port: int) -> None:
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    # Local address; state 0A: listening.
    listening = {row[1] for row in rows if row[3] == "0A" and row[1].endswith(f":{port:04X}")}
    assert listening == {f"0100007F:{port:04X}"}
