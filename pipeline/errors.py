"""Errors that a person can act on: what was expected, what was found, where, and what to do."""

from __future__ import annotations

from pathlib import Path


class KinemimicError(Exception):
    """An error of the input or of its use; the command line prints it as one line and exits with 2."""


class CaptureError(KinemimicError):
    """A capture file that cannot be read.

    `where` names the line or frame ("line 12", "frame 40"), `advice` what the user can do.
    """

    def __init__(
        self,
        path: Path | str,
        *,
        expected: str,
        found: str,
        where: str | None = None,
        advice: str | None = None,
    ) -> None:
        place = f"{path}, {where}" if where else f"{path}"
        hint = f"; {advice}" if advice else ""
        super().__init__(f"{place}: expected {expected}, found {found}{hint}")


class NotACaptureError(CaptureError):
    """A file that is no capture of any kind: neither the mark of a format nor a table of numbers."""
