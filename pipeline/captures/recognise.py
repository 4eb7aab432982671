"""Which reader a capture file takes: decided by its content, never by its name."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

from kinemimic.pipeline.captures import bvh, nui_skl
from kinemimic.pipeline.clip import Clip
from kinemimic.pipeline.errors import CaptureError

READERS = (nui_skl, bvh)
EXPECTED = " or ".join(reader.FORMAT for reader in READERS)
# Larger than any capture of a person; guards the memory against a file that is none.
MAX_BYTES = 512 * 2**20


def read(path: Path) -> Clip:
    """The capture in a file, as recorded: in our units and axes, one pass, nothing filled or filtered.

    provenance holds source (the file's name), format, sha256 and what the reader found ("reading").
    Raises CaptureError for anything that is not a whole capture in one of the formats.
    """
    content = _bytes(path)
    text = _text(content, path)
    for reader in READERS:
        if reader.recognises(text):
            clip: Clip = reader.read(text, path)
            source = {"source": path.name, "sha256": hashlib.sha256(content).hexdigest()}
            return replace(clip, provenance={**source, **clip.provenance})
    start = " ".join(text.split(maxsplit=6)[:6])[:60]
    raise CaptureError(path, expected=EXPECTED, found=f"text that begins {start!r}")


def _bytes(path: Path) -> bytes:
    try:
        if path.is_dir():
            raise CaptureError(path, expected=f"a capture file ({EXPECTED})", found="a folder")
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise CaptureError(
                path, expected=f"a capture of at most {MAX_BYTES >> 20} MiB", found=f"{size >> 20} MiB"
            )
        content = path.read_bytes()
    except FileNotFoundError:
        raise CaptureError(path, expected=f"a capture file ({EXPECTED})", found="no file") from None
    except OSError as error:
        raise CaptureError(
            path, expected="a readable file", found=(error.strerror or "an error").lower()
        ) from None
    if not content.strip():
        raise CaptureError(path, expected=EXPECTED, found="an empty file")
    return content


def _text(content: bytes, path: Path) -> str:
    # Text in any encoding that these recorders write has no NUL and hardly a control character.
    head = content[:65536]
    controls = sum(head.count(byte) for byte in range(32) if byte not in b"\t\n\r\f\x1a")
    if 0 in head or controls > 0.01 * len(head):
        raise CaptureError(path, expected=EXPECTED, found="a binary file")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        # Only joint names can hold more than ASCII; every byte is some character of Latin-1.
        text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n").rstrip("\x1a")
