"""The text of an AMC motion: per frame its number and a line for every bone, to one table of numbers.

Every frame of a real file has the same lines. Their names are struck out in the bytes, each where it must
stand, and what is left is parsed as a table at once; a file that is laid out otherwise is read line
by line, which takes longer and finds the first mistake.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.base.numbers import parse_table, to_number
from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap.asf_text import LARGEST

# What is struck out becomes a character that no text holds, and is deleted.
_SPACE, _FEED, _STRUCK = 32, 10, 1
_EIGHT_STRUCK = 0x0101010101010101
_LONGEST_LINE = 128


@dataclass(frozen=True)
class AmcText:
    """numbers: (T,) of the frames; values: bone -> (T, its degrees of freedom); keywords: in upper case,
    ":DEGREES" -> what follows it.
    """

    numbers: Array
    values: Mapping[str, Array]
    keywords: Mapping[str, str]


def parse(source: Source, widths: Mapping[str, int]) -> AmcText:
    """The motion of bones that have `widths` values each; CaptureError names the line of the first mistake.

    Bones without values need not be there.
    """
    keywords: dict[str, str] = {}
    content, start, number = source.content, 0, 0
    while start < len(content):
        end = content.find(b"\n", start)
        end = len(content) if end < 0 else end
        line = content[start:end].decode("latin-1").strip()
        number += 1
        if line.isdigit():
            break
        if line.startswith(":"):
            word, _, rest = line.partition(" ")
            keywords[word.upper()] = rest.strip()
        elif line and not line.startswith("#"):
            raise source.error(
                expected="a keyword or the first frame's number", found=repr(line[:40]),
                where=f"line {number}",
            )  # fmt: skip
        start = end + 1
    if start >= len(content):
        raise source.error(expected="frames of motion", found="none", advice="the file is cut off")
    bones, table = _at_once(source, start, widths) or _line_by_line(source, widths)
    wrong = ~(np.abs(table) < LARGEST)  # NaN too
    if wrong.any():
        frame, column = (int(k) for k in np.argwhere(wrong)[0])
        raise source.error(
            expected=f"finite numbers below {LARGEST:g}",
            found=f"{table[frame, column]:g}",
            where=f"frame {table[frame, 0] if column else frame + 1:g}",
        )
    columns = np.cumsum([1, *(widths[bone] for bone in bones)])
    values = {bone: table[:, a:b] for bone, a, b in zip(bones, columns[:-1], columns[1:], strict=True)}
    return AmcText(table[:, 0], values, keywords)


def _at_once(source: Source, start: int, widths: Mapping[str, int]) -> tuple[list[str], Array] | None:
    """Bones and table (T, 1 + values) of frames, from byte `start` on, that are all laid out as the first;
    None if they are not."""
    lines = source.content[start : start + _LONGEST_LINE * (len(widths) + 2)].split(b"\n")
    layout = next((lines[:k] for k, line in enumerate(lines) if k and line.strip().isdigit()), lines)
    if not all(line.split() for line in layout):
        return None
    names = [b"", *(line.split()[0] for line in layout[1:])]
    bones = [name.decode("latin-1") for name in names[1:]]
    if sorted(bones) != sorted(bone for bone, width in widths.items() if width):
        return None
    counts = [1, *(widths[bone] for bone in bones)]
    text = _without_names(source.content[start:], names, counts)
    try:
        if text is not None:
            return bones, parse_table(Source(source.path, text, ""), width=sum(counts)).values
    except CaptureError:
        pass  # the file's own lines tell better what is wrong
    return None


def _without_names(content: bytes, names: Sequence[bytes], counts: Sequence[int]) -> bytes | None:
    """The numbers, one frame a line, of lines that begin with `names` in turn and hold `counts` numbers."""
    end = len(content.rstrip())
    # A line feed behind the last line, and spaces, so that a look for a name never goes over the end.
    text = np.full(end + 1 + _LONGEST_LINE, _SPACE, dtype=np.uint8)
    text[:end] = np.frombuffer(content, dtype=np.uint8, count=end)
    text[end] = _FEED
    feeds = np.flatnonzero(text == _FEED)
    if len(feeds) % len(names) or max(map(len, names)) >= _LONGEST_LINE:
        return None
    ends = feeds.reshape(-1, len(names))
    starts = np.concatenate([[0], feeds[:-1] + 1]).reshape(ends.shape)
    if not all(_strike_out(text, starts[:, k], name) for k, name in enumerate(names)):
        return None
    # Every word that is left is a number; each line must hold as many as its bone has.
    word = text > _SPACE
    word[1:] &= ~word[:-1]
    numbers = np.flatnonzero(word)
    if len(numbers) != len(ends) * sum(counts):
        return None
    found = numbers.reshape(len(ends), -1)
    last = np.cumsum(counts)
    if (found[:, last - counts] < starts).any() or (found[:, last - 1] > ends).any():
        return None
    text[ends[:, :-1]] = _SPACE
    return text[: end + 1].tobytes().translate(None, bytes([_STRUCK]))


def _strike_out(text: NDArray[np.uint8], places: NDArray[np.intp], name: bytes) -> bool:
    """Strike out a name, and the space behind it, that stands at all of these places; False if it does not.

    Eight letters are looked at, and written, at once.
    """
    words: NDArray[np.uint64] = np.ndarray(len(text) - 7, dtype="<u8", buffer=text.data, strides=(1,))
    for k in range(0, len(name), 8):
        piece = name[k : k + 8]
        mask = np.uint64((1 << 8 * len(piece)) - 1)
        there = words[places + k]
        if ((there & mask) != np.uint64(int.from_bytes(piece, "little"))).any():
            return False
        words[places + k] = (there & ~mask) | (np.uint64(_EIGHT_STRUCK) & mask)
    if name:
        if (text[places + len(name)] != _SPACE).any():
            return False
        text[places + len(name)] = _STRUCK
    return True


def _line_by_line(source: Source, widths: Mapping[str, int]) -> tuple[list[str], Array]:
    """The same of frames whose lines differ in sequence; blank lines and comments are passed over."""
    bones = [bone for bone, width in widths.items() if width]
    rows: list[list[float]] = []
    frame: dict[str, list[float]] = {}
    begun = 0

    def finish(next_line: int) -> None:
        missing = [bone for bone in bones if bone not in frame]
        if missing:
            raise source.error(
                expected=f"a line for each of {len(bones)} bones in the frame of line {begun}",
                found=f"none for {', '.join(missing[:3])}",
                where=f"line {next_line}",
                advice="the file is cut off there" if next_line == len(source.lines) else None,
            )
        rows.append([number, *(value for bone in bones for value in frame[bone])])

    number = 0.0
    for line_number, line in enumerate(source.lines, 1):
        words = line.partition("#")[0].split()
        if not words or words[0].startswith(":"):
            continue
        if len(words) == 1 and words[0].isdigit() and words[0].isascii():
            if begun:
                finish(line_number)
            number, frame, begun = float(words[0][:20]), {}, line_number
            continue
        frame[words[0]] = _values(source, line_number, words, widths, again=words[0] in frame)
    finish(len(source.lines))
    return bones, np.array(rows)


def _values(
    source: Source, number: int, words: list[str], widths: Mapping[str, int], *, again: bool
) -> list[float]:
    bone = words[0]
    where = f"line {number}"
    if bone not in widths:
        raise source.error(
            expected="a frame's number or a bone of the skeleton", found=repr(bone[:40]), where=where,
            advice="the file is cut off there" if number == len(source.lines)
            else "the skeleton beside this file is another one's",
        )  # fmt: skip
    if again:
        raise source.error(expected="each bone once a frame", found=f"{bone!r} again", where=where)
    if len(words) - 1 != widths[bone]:
        raise source.error(
            expected=f"{widths[bone]} values for {bone}", found=f"{len(words) - 1}", where=where,
            advice="the file is cut off there" if number == len(source.lines)
            else "the skeleton beside this file may be another one's",
        )  # fmt: skip
    values = [value for word in words[1:] if (value := to_number(word)) is not None]
    if len(values) < widths[bone]:
        raise source.error(expected=f"numbers for {bone}", found=repr(" ".join(words[1:])[:40]), where=where)
    return values
