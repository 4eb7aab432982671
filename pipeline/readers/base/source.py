"""The content of a capture file: bounded, decompressed, decoded, with the files that belong to it."""

from __future__ import annotations

import codecs
import gzip
import hashlib
import io
import zlib
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from kinemimic.pipeline.errors import CaptureError

# Larger than any capture of a person; guards the memory against a file that is none.
MAX_BYTES = 512 * 2**20
# Of a text: an object for each takes many times the bytes of a short line; and a line's words do, too.
MAX_LINES = 5_000_000
MAX_LINE = 2**20
_HEAD = 65536
_CHUNK = 2**20
_BLANK = " \t\n\f\v,;"
_CONTROLS = bytes(b for b in range(32) if b not in b"\t\n\r\f\x1a")


class Source:
    """A file's content.

    path: where it came from, for messages and for its companions; content: bytes, decompressed, and of text
    without a byte-order mark and with lines ended by a line feed; sha256: of the file's own bytes;
    unit: of length (a name of units.UNITS), where the user names it; companions: name -> SHA-256 of the files
    beside it that were read.
    """

    def __init__(self, path: Path, content: bytes, sha256: str, unit: str | None = None) -> None:
        self.path = path
        self.content = _plain(content)
        self.sha256 = sha256
        self.unit = unit
        self.companions: dict[str, str] = {}

    @classmethod
    def open(cls, path: Path, *, unit: str | None = None) -> Source:
        """Read a file; gzip is recognised by its content. CaptureError if that cannot be done, and for more
        than MAX_BYTES, or a text of more than MAX_LINES.
        """
        try:
            if path.is_dir():
                raise CaptureError(path, expected="a capture file", found="a folder")
            size = path.stat().st_size
            if size > MAX_BYTES:
                raise _too_large(path, f"{size >> 20} MiB")
            if not path.is_file():
                raise CaptureError(path, expected="a capture file", found="a device or pipe")
            packed = path.read_bytes()
        except FileNotFoundError:
            raise CaptureError(path, expected="a capture file", found="no file") from None
        except OSError as error:
            raise CaptureError(
                path, expected="a readable file", found=(error.strerror or "an error").lower()
            ) from None
        content = _unpacked(packed, path) if packed[:2] == b"\x1f\x8b" else packed
        if not content or content.isspace():
            raise CaptureError(path, expected="a capture", found="an empty file")
        source = cls(path, content, hashlib.sha256(packed).hexdigest(), unit)
        if source.is_text and (count := source.content.count(b"\n")) > MAX_LINES:
            raise source.error(expected=f"a capture of at most {MAX_LINES:,} lines", found=f"{count:,}")
        return source

    @classmethod
    def of_text(cls, text: str, path: Path) -> Source:
        """A source from text that is in memory already."""
        content = text.encode()
        return cls(path, content, hashlib.sha256(content).hexdigest())

    @cached_property
    def is_text(self) -> bool:
        """Text in any encoding that recorders write has no NUL and hardly a control character."""
        return _is_text(self.content)

    @cached_property
    def text(self) -> str:
        """The text. Only names can hold more than ASCII, and every byte is some character of Latin-1, so that
        decoding never fails."""
        return _decoded(self.content)

    @cached_property
    def lines(self) -> Sequence[str]:
        """The lines of the text: line 1 of the file is lines[0]; CaptureError for one above MAX_LINE."""
        lines = self.text.split("\n")
        lengths = [len(line) for line in lines]
        if (longest := max(lengths)) > MAX_LINE:
            raise self.error(
                expected=f"a line of at most {MAX_LINE:,} characters",
                found=f"{longest:,}",
                where=f"line {lengths.index(longest) + 1}",
            )
        return lines

    @cached_property
    def head(self) -> tuple[str, ...]:
        """The first lines that are not blank, at most 64, of the first 64 KiB; the last may be cut off.

        Lines of separators alone are blank too: a spreadsheet writes empty rows so.
        """
        lines = (
            line for line in _decoded(self.content[:_HEAD], whole=False).split("\n") if line.strip(_BLANK)
        )
        return tuple(line for line, _ in zip(lines, range(64), strict=False))

    @cached_property
    def blank_lines(self) -> int:
        """Number of blank lines before the first other one, head[0]."""
        begin = len(self.content) - len(self.content.lstrip(_BLANK.encode()))
        return self.content.count(b"\n", 0, begin)

    def beside(self, name: str) -> Source | None:
        """A file of that name in the same folder, or None; it then is a companion of this capture."""
        if not name or not (path := self.path.with_name(name)).is_file():
            return None
        companion = Source.open(path)
        self.companions[name] = companion.sha256
        return companion

    def error(
        self, *, expected: str, found: str, where: str | None = None, advice: str | None = None
    ) -> CaptureError:
        """A CaptureError about this file."""
        return CaptureError(self.path, expected=expected, found=found, where=where, advice=advice)


def _is_text(content: bytes) -> bool:
    head = content[:_HEAD]
    controls = len(head) - len(head.translate(None, _CONTROLS))
    return 0 not in head and controls <= 0.01 * len(head)


def _decoded(content: bytes, *, whole: bool = True) -> str:
    """whole: the content does not end within a character."""
    try:
        return codecs.getincrementaldecoder("utf-8")().decode(content, final=whole)
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _plain(content: bytes) -> bytes:
    """Text without what editors and systems wrap it in; anything else as it is."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        # Windows' "Unicode text"; what only begins like it is no text.
        try:
            content = content.decode("utf-16").encode()
        except UnicodeError:
            return content
    if not _is_text(content):
        return content
    return _ended_by_line_feeds(content.removeprefix(codecs.BOM_UTF8)).rstrip(b"\x1a")


def _ended_by_line_feeds(content: bytes) -> bytes:
    """Line ends of Windows and of old Macs as line feeds; deleting is three times as fast as replacing.

    Python's csv module ends lines by two returns where a file was opened without newline="" on Windows.
    """
    if b"\r" not in content:
        return content
    values = np.frombuffer(content + b"\0", dtype=np.uint8)
    after = values[np.flatnonzero(values == ord("\r")) + 1]
    if (after == ord("\n")).all():
        return content.translate(None, b"\r")
    return content.replace(b"\r\r\n", b"\n").replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def _unpacked(packed: bytes, path: Path) -> bytes:
    """gzip's content, read piece by piece, so that a bomb is noticed before it fills the memory."""
    pieces: list[bytes] = []
    total = 0
    try:
        with gzip.open(io.BytesIO(packed)) as stream:
            while piece := stream.read(_CHUNK):
                pieces.append(piece)
                total += len(piece)
                if total > MAX_BYTES:
                    raise _too_large(path, "more, unpacked")
    except EOFError:
        raise CaptureError(
            path, expected="a whole gzip file", found="its end too early", advice="the file is cut off"
        ) from None
    except (OSError, zlib.error):
        raise CaptureError(path, expected="a gzip file", found="damaged data") from None
    return b"".join(pieces)


def _too_large(path: Path, found: str) -> CaptureError:
    return CaptureError(path, expected=f"a capture of at most {MAX_BYTES >> 20} MiB", found=found)
