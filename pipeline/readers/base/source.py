"""The content of a capture file: bounded, decompressed and decoded, with its sidecar files."""

from __future__ import annotations

import codecs
import gzip
import hashlib
import io
import itertools
import zlib
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.files.sidecars import beside
from kinemimic.pipeline.files.validation.bounded import read_bounded

# Larger than any capture of a person; protects the memory from other files.
MAX_BYTES = 512 * 2**20
# Limits of a text. Each line and each word becomes an object that is many times larger than a short line.
MAX_LINES = 5_000_000
MAX_LINE = 2**20
_HEAD = 65536
_CHUNK = 2**20
_BLANK = " \t\n\f\v,;"
_CONTROLS = bytes(b for b in range(32) if b not in b"\t\n\r\f\x1a")


class Source:
    """The content of a file.

    path: where it came from, for messages and sidecar files; content: decompressed bytes, and for text
    without a byte-order mark and with line feeds as line ends; sha256: hash of the file's own bytes; unit:
    unit of length named by the user (a key of UNITS), if any; part: which part of the file the content is,
    "sheet 'walk'", empty if it is the whole; rate: frame rate in Hz that another part states, if any;
    sidecar_files: name -> SHA-256 of the files in the same folder that were read with it.
    """

    def __init__(
        self,
        path: Path,
        content: bytes,
        sha256: str,
        unit: str | None = None,
        *,
        part: str = "",
        rate: float | None = None,
    ) -> None:
        self.path = path
        self.content = _normalised(content)
        self.sha256 = sha256
        self.unit = unit
        self.part = part
        self.rate = rate
        self.sidecar_files: dict[str, str] = {}

    @classmethod
    def open(cls, path: Path, *, unit: str | None = None) -> Source:
        """Read a file; gzip is detected from the content.

        Raises CaptureError if it cannot be read, is larger than MAX_BYTES, or is a text of more than
        MAX_LINES lines.
        """
        try:
            compressed = read_bounded(path, MAX_BYTES, "a capture file")
        except FileNotFoundError:
            raise CaptureError(path, expected="a capture file", found="no file") from None
        except OSError as error:
            raise CaptureError(
                path, expected="a readable file", found=(error.strerror or "an error").lower()
            ) from None
        content = _gunzipped(compressed, path) if compressed[:2] == b"\x1f\x8b" else compressed
        if not content or content.isspace():
            raise CaptureError(path, expected="a capture", found="an empty file")
        source = cls(path, content, hashlib.sha256(compressed).hexdigest(), unit)
        if source.is_text and (count := source.content.count(b"\n")) > MAX_LINES:
            raise source.error(expected=f"a capture of at most {MAX_LINES:,} lines", found=f"{count:,}")
        return source

    @cached_property
    def is_text(self) -> bool:
        """True if the head has no NUL and almost no control characters, as text in any encoding."""
        return _is_text(self.content)

    @cached_property
    def text(self) -> str:
        """The decoded text: UTF-8, else Latin-1, which never fails as it maps every byte. Only names can be
        non-ASCII."""
        return _decoded(self.content)

    @cached_property
    def lines(self) -> Sequence[str]:
        """The lines of the text; lines[0] is line 1 of the file. Raises CaptureError for one longer than
        MAX_LINE."""
        lines = self.text.split("\n")
        lengths = [len(line) for line in lines]
        if (longest := max(lengths)) > MAX_LINE:
            raise self.error(
                expected=f"a line of at most {MAX_LINE:,} characters",
                found=f"{longest:,}",
                line=lengths.index(longest) + 1,
            )
        return lines

    @cached_property
    def head(self) -> tuple[str, ...]:
        """The first lines that are not blank, at most 64, from the first 64 KiB; the last may be cut off.

        Lines of separators only count as blank: spreadsheets write empty rows like that. So do lines of any
        white space, no-break spaces too: every line here has a word.
        """
        return tuple(itertools.islice(itertools.filterfalse(_is_blank, self._first_lines), 64))

    @cached_property
    def blank_lines(self) -> int:
        """Number of blank lines before head[0]."""
        return sum(1 for _ in itertools.takewhile(_is_blank, self._first_lines))

    @property
    def _first_lines(self) -> list[str]:
        return _decoded(self.content[:_HEAD], whole=False).split("\n")

    def with_text(self, text: str) -> Source:
        """The same file with another text of as many lines, such as one with points for decimal commas."""
        other = Source(self.path, text.encode(), self.sha256, self.unit, part=self.part, rate=self.rate)
        other.sidecar_files = self.sidecar_files
        return other

    def sidecar_file(self, name: str) -> Source | None:
        """The file of that name in the same folder, or "../FOLDER/NAME" in one beside it, recorded as a
        sidecar file of this capture, or None."""
        if not name or not (path := beside(self.path, name)).is_file():
            return None
        sidecar = Source.open(path)
        if self.part and not sidecar.is_text:
            return None  # a workbook, of which nobody has chosen a sheet
        self.sidecar_files[name] = sidecar.sha256
        return sidecar

    def error(
        self,
        *,
        expected: str,
        found: str,
        line: int | None = None,
        where: str | None = None,
        advice: str | None = None,
    ) -> CaptureError:
        """A CaptureError about this file; line: shorthand for where="line N"."""
        where = where if line is None else f"line {line}"
        place = ", ".join(one for one in (self.part, where) if one) or None
        return CaptureError(self.path, expected=expected, found=found, where=place, advice=advice)


def _is_blank(line: str) -> bool:
    return not line.strip(_BLANK).strip()


def _is_text(content: bytes) -> bool:
    head = content[:_HEAD]
    controls = len(head) - len(head.translate(None, _CONTROLS))
    return 0 not in head and controls <= 0.01 * len(head)


def _decoded(content: bytes, *, whole: bool = True) -> str:
    """The text of these bytes. whole: the content does not end within a character."""
    try:
        return codecs.getincrementaldecoder("utf-8")().decode(content, final=whole)
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _normalised(content: bytes) -> bytes:
    """Text without byte-order mark, Windows' line ends and a final control-Z; other content unchanged."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        # Windows' "Unicode text"; other content that begins like it is not text.
        try:
            content = content.decode("utf-16").encode()
        except UnicodeError:
            return content
    if not _is_text(content):
        return content
    return _with_line_feeds(content.removeprefix(codecs.BOM_UTF8)).rstrip(b"\x1a")


def _with_line_feeds(content: bytes) -> bytes:
    """Text with the line ends of Windows and old Macs as line feeds; deleting is three times as fast as
    replacing.

    Python's csv module ends lines with two carriage returns if a file was opened without newline="" on
    Windows.
    """
    if b"\r" not in content:
        return content
    values = np.frombuffer(content + b"\0", dtype=np.uint8)
    after = values[np.flatnonzero(values == ord("\r")) + 1]
    if (after == ord("\n")).all():
        return content.translate(None, b"\r")
    return content.replace(b"\r\r\n", b"\n").replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def _gunzipped(compressed: bytes, path: Path) -> bytes:
    """The decompressed content, read in chunks so that a gzip bomb is detected before it fills the memory."""
    chunks: list[bytes] = []
    total = 0
    try:
        with gzip.open(io.BytesIO(compressed)) as stream:
            while chunk := stream.read(_CHUNK):
                chunks.append(chunk)
                total += len(chunk)
                if total > MAX_BYTES:
                    raise CaptureError(
                        path,
                        expected=f"a capture file of at most {MAX_BYTES >> 20} MB, unpacked",
                        found="a larger one",
                    )
    except EOFError:
        raise CaptureError(
            path, expected="a whole gzip file", found="a truncated one", advice="the file is cut off"
        ) from None
    except (OSError, zlib.error):
        raise CaptureError(path, expected="a gzip file", found="damaged data") from None
    return b"".join(chunks)
