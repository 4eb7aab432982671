"""TOML files, read with bounds."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.files.validation.bounded import read_bounded
from kinemimic.pipeline.files.validation.place import found_at

_PLACE = re.compile(r"\(at line (\d+), column (\d+)\)$")


def read_text(path: Path, limit: int, kind: str, shown: Path | None = None) -> str:
    """The text of a file of at most `limit` bytes.

    KinemimicError if the file is missing or not UTF-8. kind: its description in messages ("a scenario");
    shown: its name in messages, by default `path`.
    """
    try:
        return read_bounded(path, limit, kind).decode("utf-8")
    except FileNotFoundError:
        raise KinemimicError(f"{shown or path}: expected {kind}, found no file") from None
    except UnicodeDecodeError as error:
        raise KinemimicError(f"{shown or path}: expected text in UTF-8, found {error.reason}") from None


def parse_toml(path: Path, text: str) -> dict[str, Any]:
    """The values of a TOML file's text; path: its name in messages. CaptureError if it is not TOML."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise CaptureError(path, expected="TOML", found="deep nesting") from None
    except tomllib.TOMLDecodeError as error:
        raise CaptureError(path, expected="TOML", found=_found(text, str(error))) from None
    except ValueError:
        # int() refuses thousands of digits, which tomllib passes on.
        raise CaptureError(path, expected="TOML", found="a number with thousands of digits") from None


def _found(text: str, reason: str) -> str:
    """What the parser found, and where. reason: its message, which ends with the place."""
    place = _PLACE.search(reason)
    # Without a place, the parser is at the end of the text.
    line, column = (int(place[1]), int(place[2])) if place else (text.count("\n") + 1, len(text) + 1)
    if reason.startswith(("Cannot", "Duplicate")):
        return f"a key or a table for the second time in line {line}"
    return found_at(text, line, column)
