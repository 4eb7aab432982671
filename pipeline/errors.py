"""Errors that the user can fix: where, what was expected, what was found, and what to do."""

from __future__ import annotations

import copyreg
import os
from pathlib import Path
from typing import Any


class KinemimicError(Exception):
    """An error in the input or the options; the command line prints one line and exits with status 2."""


class CaptureError(KinemimicError):
    """A capture file that cannot be read.

    where: line or frame ("line 12", "frame 40"); advice: what the user can do.
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

    def __reduce__(self) -> tuple[Any, ...]:
        # Pickle would pass the message to __init__, which does not take one; errors cross processes.
        return copyreg.__newobj__, (type(self), *self.args), self.__dict__  # type: ignore[attr-defined]


class NotACaptureError(CaptureError):
    """A file that is not a capture: neither in a known format nor a table of numbers."""


def one_line(error: Exception) -> str:
    """What a user is told of an expected error, in one line.

    Of an OSError, its file, if it names one, and what the system says, without the number.
    """
    text = str(error)
    if isinstance(error, OSError):
        place = f"{os.fsdecode(error.filename)}: " if isinstance(error.filename, str | bytes) else ""
        text = place + (error.strerror or text or type(error).__name__).lower()
    return " ".join(text.splitlines())
