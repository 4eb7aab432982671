"""One file over HTTP, bounded and patient: what broke off is taken up where it ended, also the next day."""

from __future__ import annotations

import fcntl
import os
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import FileIO
from pathlib import Path

import requests
import urllib3

from kinemimic.pipeline.catalog.entry import Entry
from kinemimic.pipeline.errors import KinemimicError

_CHUNK = 65536
_OK, _PARTIAL, _UNSATISFIABLE = 200, 206, 416
_LATER = frozenset(
    {408, 425, 429, 500, 502, 503, 504}
)  # what a server says who may answer well the next time
_LONGEST_PAUSE = 60.0  # s, whatever the server asks for
# Only a strong one says that the bytes are the same.
_STRONG_ETAG = re.compile(r'"[\x21\x23-\x7e]{0,200}"')


@dataclass(frozen=True)
class RetryPolicy:
    """Seconds to wait for a connection and for more bytes, and before each further try."""

    connect: float = 10.0
    read: float = 30.0
    pauses: tuple[float, ...] = (1.0, 2.0, 4.0)


class UnreachableError(KinemimicError):
    """No connection came about: other files of the same host would wait in vain too."""


class _AgainError(Exception):
    """What may go better the next time; after: seconds that the server asks to wait; reached: it answered."""

    def __init__(self, why: str, *, after: float = 0.0, reached: bool = True) -> None:
        super().__init__(why)
        self.after, self.reached = after, reached


class Download:
    """A downloader for `pooch.retrieve`: it leaves a file of the size that the catalogue states.

    What has come is in a hidden file beside the target, named after the content that it is part of, and with
    it the server's mark of that content (ETag), by which a later call knows that it may go on from there.
    advance: told of bytes that have come, and of those that were in vain with a minus.
    """

    def __init__(
        self,
        entry: Entry,
        target: Path,
        session: requests.Session,
        retry_policy: RetryPolicy,
        advance: Callable[[int], object],
    ) -> None:
        self.entry, self.session, self.retry_policy, self.advance = entry, session, retry_policy, advance
        self.partial = target.with_name(f".{target.name}.{entry.sha256[:8]}.part")
        self.mark = self.partial.with_suffix(".etag")

    def __call__(self, url: str, output_file: str, pooch: object) -> None:
        """Raises a KinemimicError for an answer that is not the file, UnreachableError without an answer."""
        with self._opened() as file:
            self._complete(url, file)
            self.partial.replace(output_file)
            self.mark.unlink(missing_ok=True)

    def _complete(self, url: str, file: FileIO) -> None:
        try:
            for pause in (*self.retry_policy.pauses, None):
                try:
                    return self._receive(url, file)
                except _AgainError as again:
                    if pause is None:
                        raise self._given_up(url, file, again) from None
                    time.sleep(min(max(pause, again.after), _LONGEST_PAUSE))
        finally:
            if not file.tell():  # nothing to go on from
                self.partial.unlink(missing_ok=True)

    @contextmanager
    def _opened(self) -> Iterator[FileIO]:
        """The partial file at its end, ours alone."""
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
        with FileIO(os.open(self.partial, flags, 0o666), "r+") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                # Whoever had it before may have finished and moved it away.
                ours = os.path.samestat(self.partial.lstat(), os.fstat(file.fileno()))
            except (BlockingIOError, FileNotFoundError):
                ours = False
            if not ours:
                raise KinemimicError(
                    f"{self.entry.name}: expected to fetch it alone, found another process at it; wait for it"
                )
            if (have := file.seek(0, os.SEEK_END)) > self.entry.bytes:
                self._discard(file)
            else:
                self.advance(have)
            yield file

    def _receive(self, url: str, file: FileIO) -> None:
        """Add to the file what is missing; _AgainError if it stays so and another try may mend it."""
        have = file.tell()
        if have == self.entry.bytes:
            return
        headers = {"Accept-Encoding": "identity", "User-Agent": "kinemimic"}
        if have:
            headers["Range"] = f"bytes={have}-"
            if etag := self._known_mark():
                headers["If-Range"] = etag
        try:
            timeout = (self.retry_policy.connect, self.retry_policy.read)
            with self.session.get(url, headers=headers, stream=True, timeout=timeout) as response:
                self._expect(url, file, response)
                # As it is: a server that calls a .gz file "encoded" shall not have it unpacked.
                while chunk := response.raw.read1(_CHUNK, decode_content=False):
                    if file.tell() + len(chunk) > self.entry.bytes:
                        raise self._other(url, file, "more")
                    file.write(chunk)
                    self.advance(len(chunk))
        except (requests.RequestException, urllib3.exceptions.HTTPError) as error:
            raise self._broken(error) from None
        if file.tell() < self.entry.bytes:
            raise _AgainError("the connection broke off")

    def _expect(self, url: str, file: FileIO, response: requests.Response) -> None:
        """The answer's head: the whole file from its beginning, or the rest that was asked for."""
        status, have = response.status_code, file.tell()
        if status in _LATER:
            wait = response.headers.get("Retry-After", "")
            after = float(wait) if re.fullmatch(r"\d{1,6}", wait) else 0.0
            raise _AgainError(f"the server answered {status} {response.reason}", after=after)
        rest = have > 0 and status in (_PARTIAL, _UNSATISFIABLE)
        wanted = f"bytes {have}-{self.entry.bytes - 1}/{self.entry.bytes}"
        if rest and response.headers.get("Content-Range") != wanted:
            self._discard(file)
            raise _AgainError("the server has another rest of it")
        if not rest:
            if status != _OK:
                raise KinemimicError(
                    f"{self.entry.name}: expected the file at {url}, "
                    f"found the answer {status} {response.reason}"
                )
            self._discard(file)
            etag = response.headers.get("ETag", "")
            if _STRONG_ETAG.fullmatch(etag):
                self.mark.write_text(etag, encoding="ascii")
        length = response.headers.get("Content-Length", "")
        if re.fullmatch(r"\d{1,18}", length) and file.tell() + int(length) != self.entry.bytes:
            raise self._other(url, file, f"{file.tell() + int(length):,}")

    def _known_mark(self) -> str | None:
        try:
            etag = self.mark.read_text(encoding="ascii")
        except (OSError, UnicodeDecodeError):
            return None
        return etag if _STRONG_ETAG.fullmatch(etag) else None

    def _discard(self, file: FileIO) -> None:
        self.advance(-file.tell())
        file.seek(0)
        file.truncate()
        self.mark.unlink(missing_ok=True)

    def _other(self, url: str, file: FileIO, found: str) -> KinemimicError:
        """The server has another file: nothing of it is kept."""
        self._discard(file)
        return KinemimicError(
            f"{self.entry.name}: expected {self.entry.bytes:,} bytes, found {found} at {url}; nothing is kept"
        )

    def _broken(self, error: Exception) -> _AgainError:
        reason = getattr(error.args[0] if error.args else None, "reason", None)
        if isinstance(error, requests.ConnectTimeout):
            return _AgainError(f"no connection within {self.retry_policy.connect:g} s", reached=False)
        if isinstance(reason, urllib3.exceptions.NameResolutionError):
            return _AgainError("no such host, or no network", reached=False)
        if isinstance(reason, urllib3.exceptions.NewConnectionError):
            return _AgainError("no connection", reached=False)
        if isinstance(error, requests.Timeout | urllib3.exceptions.TimeoutError):
            return _AgainError(f"nothing came for {self.retry_policy.read:g} s")
        if isinstance(error, requests.exceptions.SSLError | requests.exceptions.ProxyError):
            return _AgainError(f"no connection: {reason or error}", reached=False)
        return _AgainError("the connection broke off")

    def _given_up(self, url: str, file: FileIO, again: _AgainError) -> KinemimicError:
        tries = len(self.retry_policy.pauses) + 1
        kept = f"; the {file.tell():,} that came stay, and the next call goes on from there"
        return (KinemimicError if again.reached else UnreachableError)(
            f"{self.entry.name}: expected {self.entry.bytes:,} bytes from {url}, "
            f"found in {tries} tries: {again}" + (kept if file.tell() else "")
        )
