"""A web server's request, which a test's script answers well or badly."""

from __future__ import annotations

import hashlib
import re
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler

CONTENT = hashlib.shake_128(b"a recording").digest(40_000)
ETAG = '"of-this-content"'
Script = Callable[["Request"], None]


@dataclass(frozen=True)
class Asked:
    """What a request asked for, and from where."""

    path: str
    range: str | None
    if_range: str | None
    client: tuple[str, int]


class Request(BaseHTTPRequestHandler):
    """One request; the test's script answers it."""

    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True  # or every small answer waits 40 ms for the acknowledgement of its head
    script: Script
    log: list[Asked]

    def do_GET(self) -> None:
        asked = (self.headers["Range"], self.headers["If-Range"], self.client_address)
        self.log.append(Asked(self.path, *asked))
        type(self).script(self)

    def head(self, status: int, **headers: object) -> None:
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name.replace("_", "-"), str(value))
        self.end_headers()

    def cut(self, most: int, content: bytes = CONTENT) -> None:
        """The answer that is right, but the connection breaks off after `most` bytes of the file."""
        begin = int(match[1]) if (match := re.fullmatch(r"bytes=(\d+)-", self.headers["Range"] or "")) else 0
        if begin and self.headers["If-Range"] in (None, ETAG):
            whole = f"bytes {begin}-{len(content) - 1}/{len(content)}"
            self.head(206, Content_Length=len(content) - begin, Content_Range=whole, ETag=ETAG)
        else:
            begin = 0
            self.head(200, Content_Length=len(content), ETag=ETAG)
        self.wfile.write(content[begin:most])
        self.close_connection = most < len(content)

    def whole(self, content: bytes = CONTENT) -> None:
        """The answer that is right."""
        self.cut(len(content), content)

    def log_message(self, format: str, *arguments: object) -> None:
        pass


@dataclass
class Server:
    """base: what to give as --mirror; asked: every request so far; over: set when the test has ended, for
    scripts that stall until then."""

    base: str
    asked: list[Asked]
    over: threading.Event = field(default_factory=threading.Event)

    @property
    def ranges(self) -> list[str | None]:
        return [request.range for request in self.asked]
