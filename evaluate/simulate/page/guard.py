"""Who may open the page: only this machine, only with the token, only from the page's own origin.

viser serves page and WebSocket from one port and has no check of its own. `guarded` adds one to the server
that it opens: the token in the address becomes a cookie, and both are compared in constant time.
"""

from __future__ import annotations

import functools
import hmac
import http
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

import viser
import websockets.asyncio.server
from viser import _messages
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from kinemimic.pipeline.errors import KinemimicError

HOST = "127.0.0.1"
PORTS = 100  # tried before giving up
MAX_CONNECTIONS = 16
MAX_MESSAGE = 1 << 20  # bytes from a browser; its largest are a few hundred
_PATCH = threading.Lock()


def free_port(first: int) -> int:
    """The first port from `first` on that is free on this machine; KinemimicError if there is none.

    viser would look for one beyond the last port there is, and wait forever.
    """
    for port in range(first, min(first + PORTS, 1 << 16)):
        with socket.socket() as tried:
            # As asyncio opens it: a port that a closed page has just left is free.
            tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                tried.bind((HOST, port))
            except OSError:
                continue
            return port
    raise KinemimicError(f"expected a free port of {HOST} from {first} on, found none: choose another --port")


def never_share(server: viser.ViserServer) -> None:
    """Refuse a browser's request for a tunnel from viser's share server to this one."""
    for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(message)


class Guard:
    """Decides about requests by their headers."""

    def __init__(self, token: str) -> None:
        self.token = token
        self.open = 0  # WebSockets

    def refusal(self, path: str, headers: Headers, port: int) -> str | None:
        """Why a request is refused, or None."""
        own = {f"{name}:{port}" for name in (HOST, "localhost")}
        if headers.get("Host", "") not in own:  # a foreign name that was made to resolve to 127.0.0.1
            return "another host"
        origin = headers.get("Origin")
        if origin is not None and origin not in {f"http://{name}" for name in own}:
            return "another origin"
        if not any(hmac.compare_digest(self.token, found) for found in self._tokens(path, headers, port)):
            return "no token, or a wrong one: open the address that the terminal shows"
        if headers.get("Upgrade", "").lower() == "websocket":
            if origin is None:
                return "no origin"
            if self.open >= MAX_CONNECTIONS:
                return f"{MAX_CONNECTIONS} viewers already"
        return None

    def cookie(self, port: int) -> str:
        """The header that lets a browser come back without the token in the address."""
        return f"kinemimic-{port}={self.token}; HttpOnly; SameSite=Strict; Path=/"

    def _tokens(self, path: str, headers: Headers, port: int) -> list[str]:
        found = parse_qs(urlsplit(path).query).get("token", [])
        try:
            cookies = SimpleCookie("; ".join(headers.get_all("Cookie")))
        except CookieError:
            return found
        if (own := cookies.get(f"kinemimic-{port}")) is not None:
            found = [*found, own.value]
        return [one for one in found if one.isascii()]


@contextmanager
def guarded(token: str) -> Iterator[Guard]:
    """Within it, servers of `websockets` open with a guard: construct `viser.ViserServer` there."""
    guard, serve = Guard(token), websockets.asyncio.server.serve

    @functools.wraps(serve)
    def checked(handler: Callable[..., Any], *args: Any, **options: Any) -> Any:
        answer = options.pop("process_request")

        def process(connection: Any, request: Request) -> Response | None:
            port = connection.transport.get_extra_info("sockname")[1]
            if (why := guard.refusal(request.path, request.headers, port)) is not None:
                body = f"kinemimic: {why}\n".encode()
                headers = Headers([("Content-Type", "text/plain"), ("Content-Length", str(len(body)))])
                return Response(http.HTTPStatus.FORBIDDEN, "Forbidden", headers, body)
            response: Response | None = answer(connection, request)
            if response is not None:
                response.headers["Set-Cookie"] = guard.cookie(port)
                response.headers["Referrer-Policy"] = "no-referrer"
            return response

        async def counted(connection: Any) -> None:
            guard.open += 1
            try:
                await handler(connection)
            finally:
                guard.open -= 1

        return serve(counted, *args, process_request=process, **{**options, "max_size": MAX_MESSAGE})

    with _PATCH:
        websockets.asyncio.server.serve = checked  # type: ignore[assignment,misc]
        try:
            yield guard
        finally:
            websockets.asyncio.server.serve = serve  # type: ignore[misc]
