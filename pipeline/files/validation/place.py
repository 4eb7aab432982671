"""What stands at a place of a text, for errors."""

from __future__ import annotations

_SHOWN = 20  # characters


def found_at(text: str, line: int, column: int) -> str:
    """Such as "'}' in line 2, column 5", counted from 1; "the end of the text" where nothing follows."""
    lines = text.split("\n")[line - 1 :]
    rest = lines[0][column - 1 :] if lines else ""
    if not rest.strip() and not any(map(str.strip, lines[1:])):
        return f"the end of the text in line {line}"
    what = repr(rest[:_SHOWN]) if rest.strip() else "the end of the line"
    return f"{what} in line {line}, column {column}"
