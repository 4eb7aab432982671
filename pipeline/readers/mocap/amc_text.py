"""Parse the text of an AMC motion into one table; each frame is its number and a line for every bone.

In real files every frame has the same lines. Their names are blanked out in the bytes, at the positions where
they must be, and the rest is parsed as a table in one go. A file with another layout is read line by line,
which is slower and finds the first mistake.
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
from kinemimic.pipeline.readers.mocap.asf_text import MAX_NUMBER

# Names are overwritten with a character that no text contains, which is then deleted.
_SPACE, _FEED, _BLANKED = 32, 10, 1
_EIGHT_BLANKED = 0x0101010101010101
_MAX_LINE = 128


@dataclass(frozen=True)
class AmcText:
    """numbers: (T,) of the frames; values: bone -> (T, number of its degrees of freedom); keywords: in upper
    case, ":DEGREES" -> the text after it."""

    numbers: Array
    values: Mapping[str, Array]
    keywords: Mapping[str, str]


def parse(source: Source, widths: Mapping[str, int]) -> AmcText:
    """The motion of bones with `widths` values each; CaptureError names the line of the first mistake.

    Bones without values may be absent.
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
                line=number,
            )  # fmt: skip
        start = end + 1
    if start >= len(content):
        raise source.error(expected="frames of motion", found="none", advice="the file is cut off")
    bones, table = _parse_regular(source, start, widths) or _parse_by_line(source, widths)
    wrong = ~(np.abs(table) < MAX_NUMBER)  # NaN too
    if wrong.any():
        frame, column = (int(k) for k in np.argwhere(wrong)[0])
        raise source.error(
            expected=f"finite numbers below {MAX_NUMBER:g}",
            found=f"{table[frame, column]:g}",
            where=f"frame {table[frame, 0] if column else frame + 1:g}",
        )
    columns = np.cumsum([1, *(widths[bone] for bone in bones)])
    values = {bone: table[:, a:b] for bone, a, b in zip(bones, columns[:-1], columns[1:], strict=True)}
    return AmcText(table[:, 0], values, keywords)


def _parse_regular(source: Source, start: int, widths: Mapping[str, int]) -> tuple[list[str], Array] | None:
    """Bones and table (T, 1 + values) of the frames from byte `start` on, if all have the layout of the
    first; else None."""
    lines = source.content[start : start + _MAX_LINE * (len(widths) + 2)].split(b"\n")
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
        pass  # parsing the file's own lines gives a better message
    return None


def _without_names(content: bytes, names: Sequence[bytes], counts: Sequence[int]) -> bytes | None:
    """The numbers, one frame per line, if the lines begin with `names` in turn and hold `counts` numbers;
    else None."""
    end = len(content.rstrip())
    # A line feed after the last line, and spaces, so that looking for a name never reads beyond the end.
    text = np.full(end + 1 + _MAX_LINE, _SPACE, dtype=np.uint8)
    text[:end] = np.frombuffer(content, dtype=np.uint8, count=end)
    text[end] = _FEED
    feeds = np.flatnonzero(text == _FEED)
    if len(feeds) % len(names) or max(map(len, names)) >= _MAX_LINE:
        return None
    ends = feeds.reshape(-1, len(names))
    starts = np.concatenate([[0], feeds[:-1] + 1]).reshape(ends.shape)
    if not all(_blank_out(text, starts[:, k], name) for k, name in enumerate(names)):
        return None
    # All remaining words are numbers; each line must hold as many as its bone has values.
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
    return text[: end + 1].tobytes().translate(None, bytes([_BLANKED]))


def _blank_out(text: NDArray[np.uint8], places: NDArray[np.intp], name: bytes) -> bool:
    """Blank out a name and the space after it at all of these positions; False if it is not at one of them.

    Compares and writes eight letters at a time.
    """
    words: NDArray[np.uint64] = np.ndarray(len(text) - 7, dtype="<u8", buffer=text.data, strides=(1,))
    for k in range(0, len(name), 8):
        chunk = name[k : k + 8]
        mask = np.uint64((1 << 8 * len(chunk)) - 1)
        letters = words[places + k]
        if ((letters & mask) != np.uint64(int.from_bytes(chunk, "little"))).any():
            return False
        words[places + k] = (letters & ~mask) | (np.uint64(_EIGHT_BLANKED) & mask)
    if name:
        if (text[places + len(name)] != _SPACE).any():
            return False
        text[places + len(name)] = _BLANKED
    return True


def _parse_by_line(source: Source, widths: Mapping[str, int]) -> tuple[list[str], Array]:
    """Like `_parse_regular`, for frames with lines in any order; skips blank lines and comments."""
    bones = [bone for bone, width in widths.items() if width]
    rows: list[list[float]] = []
    frame: dict[str, list[float]] = {}
    start_line = 0

    def finish(next_line: int) -> None:
        missing = [bone for bone in bones if bone not in frame]
        if missing:
            raise source.error(
                expected=f"a line for each of {len(bones)} bones in the frame of line {start_line}",
                found=f"none for {', '.join(missing[:3])}",
                line=next_line,
                advice="the file is cut off there" if next_line == len(source.lines) else None,
            )
        rows.append([number, *(value for bone in bones for value in frame[bone])])

    number = 0.0
    for line_number, line in enumerate(source.lines, 1):
        words = line.partition("#")[0].split()
        if not words or words[0].startswith(":"):
            continue
        if len(words) == 1 and words[0].isdigit() and words[0].isascii():
            if start_line:
                finish(line_number)
            number, frame, start_line = float(words[0][:20]), {}, line_number
            continue
        frame[words[0]] = _values(source, line_number, words, widths, repeated=words[0] in frame)
    finish(len(source.lines))
    return bones, np.array(rows)


def _values(
    source: Source, number: int, words: list[str], widths: Mapping[str, int], *, repeated: bool
) -> list[float]:
    bone = words[0]
    if bone not in widths:
        raise source.error(
            expected="a frame's number or a bone of the skeleton", found=repr(bone[:40]), line=number,
            advice="the file is cut off there" if number == len(source.lines)
            else "the skeleton in the same folder belongs to another motion",
        )  # fmt: skip
    if repeated:
        raise source.error(expected="each bone once per frame", found=f"{bone!r} again", line=number)
    if len(words) - 1 != widths[bone]:
        raise source.error(
            expected=f"{widths[bone]} values for {bone}", found=f"{len(words) - 1}", line=number,
            advice="the file is cut off there" if number == len(source.lines)
            else "the skeleton in the same folder may belong to another motion",
        )  # fmt: skip
    values = [value for word in words[1:] if (value := to_number(word)) is not None]
    if len(values) < widths[bone]:
        raise source.error(expected=f"numbers for {bone}", found=repr(" ".join(words[1:])[:40]), line=number)
    return values
