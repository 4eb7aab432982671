"""Variables of a MAT-file of version 5, which MATLAB writes with `save` and with `-v6` and `-v7`.

MathWorks, "MAT-File Level 5 File Format" (MAT-File Format, 2023). `scipy.io.loadmat` would unpack whatever
a file claims, and follows its nesting in C without a limit.
"""

from __future__ import annotations

import itertools
import math
import struct
import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from kinemimic.pipeline.readers.base.source import MAX_BYTES, Source

# Numbers, text, a cell array's values in MATLAB's order, a structure's fields or one Mapping for each element
# of an array of structures; None for anything else.
Value = Any
MARK = b"MATLAB 5.0 MAT-file"
_HEADER = 128  # bytes
_ORDERS = {b"IM": "<", b"MI": ">"}  # last bytes of the header -> byte order
_MATRIX, _COMPRESSED = 14, 15
# Type of an element -> that of its numbers, and its text's encoding.
_NUMBERS = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
_TEXTS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
# Class of an array -> its kind.
_CELL, _STRUCT, _CHAR, _NUMBER = "cell", "struct", "char", "number"
_KINDS = {1: _CELL, 2: _STRUCT, 4: _CHAR, **dict.fromkeys(range(6, 16), _NUMBER)}
_OPAQUE = 17  # strings, tables and other objects of MATLAB: flags, name and what only MATLAB knows
_COMPLEX = 0x0800
_MAX_DEPTH = 16
_MAX_VALUES = 1_000_000  # in cells, fields and lines of text of a variable
_MAX_VARIABLES = 1_000
_HEAD = 65_536  # bytes of a variable that `heads` unpacks
_DAMAGE = (ValueError, struct.error, zlib.error, IndexError, OverflowError, RecursionError, MemoryError)


@dataclass(frozen=True)
class Head:
    """What a variable is; fields: names of a structure's."""

    shape: tuple[int, ...]
    kind: str
    fields: tuple[str, ...] = ()


def is_mat5(source: Source) -> bool:
    """Whether the content begins like such a file."""
    return source.content.startswith(MARK) and source.content[_HEADER - 2 : _HEADER] in _ORDERS


def heads(source: Source) -> dict[str, Head]:
    """Name -> head of the variables, in the file's order, the first of a name; empty for another file.

    Never raises: what comes after damage is left out.
    """
    found: dict[str, Head] = {}
    try:
        for element in _variables(source):
            name, head, _ = _head(_matrix(element, _HEAD))
            found.setdefault(name, head)
    except _DAMAGE:
        pass
    return found


def variables(source: Source, wanted: Collection[str]) -> dict[str, Value]:
    """Name -> value of those of the wanted variables that the file has, the first of a name.

    Only these are unpacked. Raises CaptureError for a damaged file, and if they unpack to more than MAX_BYTES
    together.
    """
    found: dict[str, Value] = {}
    room = MAX_BYTES
    try:
        for element in _variables(source):
            name = _head(_matrix(element, _HEAD))[0]
            if name not in wanted or name in found:
                continue
            matrix = _matrix(element, room + 1)
            room -= len(matrix.data)
            if room < 0:
                raise source.error(
                    expected=f"at most {MAX_BYTES >> 20} MB of markers or joints", found="more"
                )
            found[name] = _Values().of(matrix)
            if len(found) == len(wanted):
                break
    except _DAMAGE as error:
        what = " ".join(str(error).split())[:80] or type(error).__name__
        raise source.error(expected="a whole MAT-file", found=f"damage ({what})") from None
    return found


class _Element(NamedTuple):
    kind: int
    data: memoryview
    order: str

    def parts(self) -> Iterator[_Element]:
        """The elements inside."""
        return _elements(self.data, self.order)

    def numbers(self) -> Any:
        """Its data as an array (N,)."""
        if self.kind not in _NUMBERS:
            raise ValueError(f"numbers of type {self.kind}")
        return np.frombuffer(self.data, dtype=self.order + _NUMBERS[self.kind])

    def text(self) -> str:
        """Its data as text."""
        encoding = _TEXTS.get(self.kind)
        if encoding is None:
            raise ValueError(f"text of type {self.kind}")
        if encoding in ("utf-16", "utf-32"):
            encoding += "-le" if self.order == "<" else "-be"
        return bytes(self.data).decode(encoding, errors="replace")


def _elements(data: memoryview, order: str) -> Iterator[_Element]:
    """The elements of a stretch of bytes; the last may be cut off."""
    at = 0
    while at + 8 <= len(data):
        (first,) = struct.unpack_from(order + "I", data, at)
        if first >> 16:  # up to four bytes, in the tag itself
            yield _Element(first & 0xFFFF, data[at + 4 : at + 4 + min(first >> 16, 4)], order)
            at += 8
            continue
        (size,) = struct.unpack_from(order + "I", data, at + 4)
        yield _Element(first, data[at + 8 : at + 8 + size], order)
        at += 8 + size + (0 if first == _COMPRESSED else -size % 8)


def _variables(source: Source) -> Iterator[_Element]:
    """The elements that hold a variable each; what comes after another element is damage, and left out."""
    if not is_mat5(source):
        return
    order = _ORDERS[source.content[_HEADER - 2 : _HEADER]]
    elements = _elements(memoryview(source.content)[_HEADER:], order)
    for element in itertools.islice(elements, _MAX_VARIABLES):
        if element.kind not in (_MATRIX, _COMPRESSED):
            return
        yield element


def _matrix(element: _Element, most: int) -> _Element:
    """The matrix of a variable, at most so many bytes of it."""
    if element.kind == _MATRIX:
        return element._replace(data=element.data[:most])
    # 8 bytes are the tag of what is inside.
    stream = zlib.decompressobj()
    unpacked = memoryview(stream.decompress(element.data, most + 8))
    if not stream.eof and len(unpacked) < most + 8:
        raise ValueError("compressed data are cut off")
    (kind,) = struct.unpack_from(element.order + "I", unpacked)
    return _Element(kind, unpacked[8:], element.order)


def _head(matrix: _Element) -> tuple[str, Head, Iterator[_Element]]:
    """The name and head of a matrix, and the elements that follow."""
    if matrix.kind != _MATRIX:
        raise ValueError(f"an element of type {matrix.kind} in place of a matrix")
    parts = matrix.parts()
    flag = int(_next(parts).numbers()[0])
    if flag & 0xFF == _OPAQUE:
        return _next(parts).text(), Head((), ""), parts
    dimensions, name = _next(parts), _next(parts)
    kind = "" if flag & _COMPLEX else _KINDS.get(flag & 0xFF, "")
    shape = tuple(int(size) for size in dimensions.numbers())
    if len(shape) < 2 or min(shape) < 0:
        raise ValueError(f"a shape of {shape}"[:60])
    return name.text(), Head(shape, kind, _fields(parts) if kind == _STRUCT else ()), parts


def _fields(parts: Iterator[_Element]) -> tuple[str, ...]:
    """Names of a structure's fields, each padded with NUL to the same length."""
    length, names = int(_next(parts).numbers()[0]), _next(parts).text()
    if length < 1 or len(names) > length * _MAX_VALUES:
        raise ValueError("names of fields")
    return tuple(names[k : k + length].partition("\0")[0] for k in range(0, len(names), length))


def _next(parts: Iterator[_Element]) -> _Element:
    found = next(parts, None)
    if found is None:
        raise ValueError("it is cut off")
    return found


class _Values:
    """Reads the values of a variable, and counts them."""

    def __init__(self) -> None:
        self._count = 0

    def of(self, matrix: _Element, depth: int = 0) -> Value:
        """The value of a matrix; None for an empty element."""
        if matrix.kind == _MATRIX and not matrix.data:
            return None
        if depth > _MAX_DEPTH:
            raise ValueError("cells and structures too deep")
        _, head, parts = _head(matrix)
        if head.kind == _NUMBER:
            return _next(parts).numbers().reshape(head.shape, order="F")
        if head.kind == _CHAR:
            return self._lines(_next(parts).text(), head.shape)
        count = math.prod(head.shape)
        if head.kind == _CELL:
            return self._inside(parts, count, depth)
        if head.kind == _STRUCT:
            values = self._inside(parts, count * len(head.fields), depth)
            rows = [
                dict(zip(head.fields, values[k : k + len(head.fields)], strict=True))
                for k in range(0, len(values), len(head.fields) or 1)
            ]
            return rows[0] if count == 1 and rows else rows
        return None

    def _inside(self, parts: Iterator[_Element], count: int, depth: int) -> list[Value]:
        self._add(count)
        return [self.of(_next(parts), depth + 1) for _ in range(count)]

    def _lines(self, text: str, shape: Sequence[int]) -> str | list[str]:
        """A row of characters as text, several rows as a list without the blanks that pad them."""
        rows = shape[0]
        if rows <= 1:
            return text
        self._add(rows)
        if math.prod(shape) != len(text):
            raise ValueError(f"{len(text)} characters in place of {math.prod(shape)}")
        return [text[k::rows].rstrip() for k in range(rows)]

    def _add(self, count: int) -> None:
        self._count += count
        if self._count > _MAX_VALUES:
            raise ValueError(f"more than {_MAX_VALUES:,} values")


def texts(value: Value) -> tuple[str, ...]:
    """Names in a cell array of text, or in the rows of an array of characters; none for other values."""
    if isinstance(value, str):
        return (value,)
    if isinstance(value, list) and all(one is None or isinstance(one, str) for one in value):
        return tuple(one or "" for one in value)
    return ()


def field(value: Value, *path: str) -> Value:
    """A field of a structure, or of the first structure in an array of them; None without it."""
    for name in path:
        if isinstance(value, list):
            value = value[0] if value else None
        value = value.get(name) if isinstance(value, Mapping) else None
    return value
