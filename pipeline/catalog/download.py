"""Download a file over HTTP with a size limit, retries, and resumption of partial downloads."""

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
from requests.exceptions import InvalidSchema, InvalidURL, MissingSchema

from kinemimic.pipeline.catalog.entry import Entry
from kinemimic.pipeline.errors import KinemimicError

_CHUNK = 65536
_OK, _PARTIAL, _UNSATISFIABLE = 200, 206, 416
_RETRYABLE = frozenset({408, 425, 429, 500, 502, 503, 504})
_MAX_PAUSE = 60.0  # s, even if the server asks for more
_CREDENTIALS = re.compile(r"(?<=//)[^\s/]*@|(?<![^\s'\"])[^\s/:]+:[^\s/]*@")
# Only a strong ETag guarantees identical bytes.
_STRONG_ETAG = re.compile(r'"[\x21\x23-\x7e]{0,200}"')


@dataclass(frozen=True)
class RetryPolicy:
    """Timeouts in seconds for the connection and for data, and the pauses before retries."""

    connect: float = 10.0
    read: float = 30.0
    pauses: tuple[float, ...] = (1.0, 2.0, 4.0)


def without_credentials(text: str) -> str:
    """A text without the user names and passwords of the URLs in it, such as that of a mirror or a proxy."""
    return _CREDENTIALS.sub("", text)


class UnreachableError(KinemimicError):
    """No connection to the host: other files on it cannot be fetched either."""


class _RetryableError(Exception):
    """A temporary failure; after: seconds to wait, as requested by the server; reached: the host answered."""

    def __init__(self, why: str, *, after: float = 0.0, reached: bool = True) -> None:
        super().__init__(why)
        self.after, self.reached = after, reached


class Download:
    """A downloader for `pooch.retrieve`; the file has the size stated in the catalogue.

    A partial download is kept in a hidden file beside the target, named after the content's hash, together
    with the server's ETag, so that a later call can resume it.
    advance: called with the number of bytes received, or minus the number of bytes discarded.
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
        self.etag_file = self.partial.with_suffix(".etag")

    def __call__(self, url: str, output_file: str, pooch: object) -> None:
        """Download the file. KinemimicError for a wrong answer, UnreachableError without an answer."""
        with self._locked_partial_file() as file:
            self._complete(url, file)
            self.partial.replace(output_file)
            self.etag_file.unlink(missing_ok=True)

    def _complete(self, url: str, file: FileIO) -> None:
        try:
            for pause in (*self.retry_policy.pauses, None):
                try:
                    return self._receive(url, file)
                except _RetryableError as error:
                    if pause is None:
                        raise self._given_up(url, file, error) from None
                    time.sleep(min(max(pause, error.after), _MAX_PAUSE))
        finally:
            if not file.tell():  # nothing to resume
                self.partial.unlink(missing_ok=True)

    @contextmanager
    def _locked_partial_file(self) -> Iterator[FileIO]:
        """The partial file, positioned at its end and locked."""
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
        with FileIO(os.open(self.partial, flags, 0o666), "r+") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                # The previous owner of the lock may have finished and moved the file.
                ours = os.path.samestat(self.partial.lstat(), os.fstat(file.fileno()))
            except (BlockingIOError, FileNotFoundError):
                ours = False
            if not ours:
                raise KinemimicError(
                    f"{self.entry.name}: expected no other download of this file, found one running; "
                    "wait until it ends"
                )
            if (have := file.seek(0, os.SEEK_END)) > self.entry.bytes:
                self._discard(file)
            else:
                self.advance(have)
            yield file

    def _receive(self, url: str, file: FileIO) -> None:
        """Append the missing bytes to the file; _RetryableError if another attempt may succeed."""
        have = file.tell()
        if have == self.entry.bytes:
            return
        headers = {"Accept-Encoding": "identity", "User-Agent": "kinemimic"}
        if have:
            headers["Range"] = f"bytes={have}-"
            if etag := self._known_etag():
                headers["If-Range"] = etag
        try:
            timeout = (self.retry_policy.connect, self.retry_policy.read)
            with self.session.get(url, headers=headers, stream=True, timeout=timeout) as response:
                self._check_response(url, file, response)
                # Undecoded: some servers declare .gz files as encoded content.
                while chunk := response.raw.read1(_CHUNK, decode_content=False):
                    if file.tell() + len(chunk) > self.entry.bytes:
                        raise self._wrong_size(url, file, "more")
                    file.write(chunk)
                    self.advance(len(chunk))
        except requests.TooManyRedirects:
            raise self._refused(url, f"more than {self.session.max_redirects} redirects") from None
        except (InvalidSchema, MissingSchema, InvalidURL, ValueError) as error:
            # Of a redirect, or of a mirror that is not a URL.
            raise self._refused(url, f"an address that is not fetched ({error})") from None
        except (requests.RequestException, urllib3.exceptions.HTTPError) as error:
            raise self._retryable(error) from None
        if file.tell() < self.entry.bytes:
            raise _RetryableError("the connection was interrupted")

    def _check_response(self, url: str, file: FileIO, response: requests.Response) -> None:
        """Check the status and headers: the whole file, or the requested range."""
        status, have = response.status_code, file.tell()
        if status in _RETRYABLE:
            wait = response.headers.get("Retry-After", "")
            after = float(wait) if re.fullmatch(r"\d{1,6}", wait) else 0.0
            raise _RetryableError(f"the server answered {status} {response.reason}", after=after)
        rest = have > 0 and status in (_PARTIAL, _UNSATISFIABLE)
        wanted = f"bytes {have}-{self.entry.bytes - 1}/{self.entry.bytes}"
        if rest and response.headers.get("Content-Range") != wanted:
            self._discard(file)
            raise _RetryableError("the server sent a different range of bytes")
        if not rest:
            if status != _OK:
                raise KinemimicError(
                    f"{self.entry.name}: expected the file at {url}, found status {status} {response.reason}"
                )
            self._discard(file)
            etag = response.headers.get("ETag", "")
            if _STRONG_ETAG.fullmatch(etag):
                self.etag_file.write_text(etag, encoding="ascii")
        length = response.headers.get("Content-Length", "")
        if re.fullmatch(r"\d{1,18}", length) and file.tell() + int(length) != self.entry.bytes:
            raise self._wrong_size(url, file, f"{file.tell() + int(length):,}")

    def _known_etag(self) -> str | None:
        try:
            etag = self.etag_file.read_text(encoding="ascii")
        except (OSError, UnicodeDecodeError):
            return None
        return etag if _STRONG_ETAG.fullmatch(etag) else None

    def _discard(self, file: FileIO) -> None:
        self.advance(-file.tell())
        file.seek(0)
        file.truncate()
        self.etag_file.unlink(missing_ok=True)

    def _wrong_size(self, url: str, file: FileIO, found: str) -> KinemimicError:
        """The error for a different file on the server; discards the partial download."""
        self._discard(file)
        return KinemimicError(
            f"{self.entry.name}: expected {self.entry.bytes:,} bytes, found {found} at {url}; "
            "the download was discarded"
        )

    def _refused(self, url: str, found: str) -> KinemimicError:
        """The error for an answer that another attempt would not change."""
        return KinemimicError(f"{self.entry.name}: expected the file at {url}, found {found}")

    def _retryable(self, error: Exception) -> _RetryableError:
        reason = getattr(error.args[0] if error.args else None, "reason", None)
        if isinstance(error, requests.ConnectTimeout):
            return _RetryableError(f"no connection within {self.retry_policy.connect:g} s", reached=False)
        if isinstance(reason, urllib3.exceptions.NameResolutionError):
            return _RetryableError("unknown host, or no network", reached=False)
        if isinstance(reason, urllib3.exceptions.NewConnectionError):
            return _RetryableError("no connection", reached=False)
        if isinstance(error, requests.Timeout | urllib3.exceptions.TimeoutError):
            return _RetryableError(f"no data for {self.retry_policy.read:g} s")
        if isinstance(error, requests.exceptions.SSLError | requests.exceptions.ProxyError):
            return _RetryableError(f"no connection: {reason or error}", reached=False)
        return _RetryableError("the connection was interrupted")

    def _given_up(self, url: str, file: FileIO, last: _RetryableError) -> KinemimicError:
        tries = len(self.retry_policy.pauses) + 1
        attempts = f"{tries} attempt{'s' if tries > 1 else ''}"
        kept = f"; {file.tell():,} bytes are kept, and the next call resumes there"
        return (KinemimicError if last.reached else UnreachableError)(
            f"{self.entry.name}: expected {self.entry.bytes:,} bytes from {url}, "
            f"found after {attempts}: {last}" + (kept if file.tell() else "")
        )
