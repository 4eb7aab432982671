"""Find the columns of a table by their names in its header."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence

from kinemimic.pipeline.readers.base.source import Source

# What to do about a table whose columns are not those of its format.
DESCRIBE = "or describe its columns (`kinemimic inspect --suggest FILE` drafts that)"

_WORD = re.compile(r"[^\W\d_]+|\d+")
_HUMP = re.compile(r"(?<=[a-z])(?=[A-Z])")


def words_of(name: str) -> list[str]:
    """The words and numbers of a name in lower case: of "leftKnee.x" left, knee, x; of "L0_x" l, 0, x."""
    return _WORD.findall(_HUMP.sub(" ", name).lower())


def semicolon_or_comma(source: Source) -> str:
    """The separator of a header: a semicolon if it has one."""
    return ";" if ";" in source.head[0] else ","


def index_of_columns(names: Sequence[str], source: Source, line: int) -> dict[str, int]:
    """Column of each name; CaptureError if a name occurs twice. line: of the header, from 1."""
    index = {name: column for column, name in enumerate(names)}
    if len(index) != len(names):
        twice = next(name for column, name in enumerate(names) if index[name] != column)
        raise source.error(
            expected="column names once each",
            found=f"{twice[:40]!r} twice",
            line=line,
            advice="rename or delete one of the two columns",
        )
    return index


def require_columns(
    index: Mapping[str, int],
    wanted: Sequence[str],
    source: Source,
    line: int,
    *,
    expected: str,
    key: Callable[[str], str] = str,
) -> list[int]:
    """Columns of the wanted names; CaptureError lists the missing ones. key: name -> its key in `index`."""
    missing = [name for name in wanted if key(name) not in index]
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        raise source.error(
            expected=expected,
            found=f"no column {', '.join(missing[:3])}{more}",
            line=line,
            advice=f"restore the columns, {DESCRIBE}",
        )
    return [index[key(name)] for name in wanted]
