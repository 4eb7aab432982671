"""Text of files on a terminal or a page: without control characters, in any encoding.

Names in a capture, keys of a damaged file and names of files may contain anything, such as the escape
sequences that rename a terminal's window, delete its lines, or write to the clipboard.
"""

from __future__ import annotations

import codecs
import re
import sys
import unicodedata

import click

_KEPT = "\n\t"
# Fast, for whole pages: no character beyond these ranges needs a closer look.
_SUSPECT = re.compile("[^\n\t -~\u00a0-\u00ac\u00ae-\u05ff\u2010-\u2027\u2030-\u205e\u2070-\uabff]")
# What our own texts contain beyond ASCII, for terminals without it.
_ASCII = {
    "–": "-", "−": "-", "—": "-", "…": "...", "“": '"', "”": '"', "’": "'", "\u00a0": " ",
    "°": " deg", "²": "^2", "³": "^3", "µ": "u", "±": "+-", "×": "x", "·": "*", "→": "->",
    "≥": ">=", "≤": "<=",
}  # fmt: skip


def printable(text: str) -> str:
    r"""The text with control and format characters as \u001b; line ends, tabs and spaces stay.

    Format characters include those that reverse the direction of text and those that cannot be seen. In JSON
    and TOML, the replacement means the same character.
    """
    if _SUSPECT.search(text) is None:
        return text
    return "".join(one if _is_plain(one) else _escaped(one) for one in text)


def echo(text: str = "", *, err: bool = False, nl: bool = True, bold: bool = False) -> None:
    """Print text that may come from a file; bold only on a terminal."""
    # Given a file, click keeps its encoding; else it writes UTF-8 where the user asked for ASCII.
    click.secho(printable(text), file=sys.stderr if err else sys.stdout, nl=nl, bold=bold or None)


def replace_what_cannot_be_encoded() -> None:
    """Let stdout and stderr print in every encoding, such as those of `PYTHONIOENCODING=ascii` and LC_ALL=C.

    Signs get a form in ASCII, other characters their number.
    """
    codecs.register_error("kinemimic", _in_ascii)
    for stream in (sys.stdout, sys.stderr):
        # A test or a notebook may have replaced it by another kind of stream.
        if (reconfigure := getattr(stream, "reconfigure", None)) is not None:
            reconfigure(errors="kinemimic")


def _is_plain(one: str) -> bool:
    return one in _KEPT or one.isprintable() or unicodedata.category(one) == "Zs"


def _escaped(one: str) -> str:
    return f"\\u{ord(one):04x}" if ord(one) < 0x10000 else f"\\U{ord(one):08x}"


def _in_ascii(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    found = error.object[error.start : error.end]
    return "".join(_ASCII.get(one) or _escaped(one) for one in found), error.end
