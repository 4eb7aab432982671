"""Rewrite a C3D file of a big-endian computer (processor type MIPS) in the byte order of Intel's: ezc3d reads
only that and DEC's.
"""

from __future__ import annotations

import struct

import numpy as np

from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.mocap.c3d_layout import BLOCK

INTEL, MIPS = 84, 86
# Bytes of the header from .. to that are words of two bytes, and of four.
_WORDS = ((2, 12), (16, 20), (294, 304))
_FLOATS = ((12, 16), (20, 24), (304, 376))
# Types of parameters: size of their elements in bytes.
_SIZES = {-1: 1, 1: 1, 2: 2, 4: 4}


def is_mips(content: bytes) -> bool:
    """Whether a file of `c3d_layout.check_layout` was written by a big-endian computer."""
    return content[(content[0] - 1) * BLOCK + 3] == MIPS


def as_intel(source: Source) -> bytes:
    """The content in Intel's byte order. CaptureError for damaged parameters."""
    content = bytearray(source.content)
    (scale,) = struct.unpack_from(">f", content, 12)
    (block,) = struct.unpack_from(">H", content, 16)
    for spans, size in ((_WORDS, 2), (_FLOATS, 4)):
        for start, end in spans:
            _swap(content, start, end, size)
    start = (content[0] - 1) * BLOCK
    content[start + 3] = INTEL
    try:
        _swap_parameters(content, start + 4, start + content[start + 2] * BLOCK)
    except (struct.error, IndexError, KeyError):
        raise source.error(expected="parameters of a C3D file", found="damage") from None
    _swap(content, (block - 1) * BLOCK, len(content), 4 if scale < 0 else 2)
    return bytes(content)


def _swap_parameters(content: bytearray, at: int, end: int) -> None:
    """Each record: length of its name, its group (negative: it is a group), the name, the offset of the next
    record, and of a parameter its type, dimensions and data."""
    while at < end and content[at]:
        length, group = struct.unpack_from("bb", content, at)
        at += 2 + abs(length)
        (offset,) = struct.unpack_from(">h", content, at)
        _swap(content, at, at + 2, 2)
        if group > 0:
            size = _SIZES[struct.unpack_from("b", content, at + 2)[0]]
            dimensions = content[at + 4 : at + 4 + content[at + 3]]
            data = at + 4 + len(dimensions)
            count = int(np.prod(np.array(dimensions, dtype=np.float64)))
            _swap(content, data, min(data + size * count, end), size)
        if offset <= 0:
            return
        at += offset


def _swap(content: bytearray, start: int, end: int, size: int) -> None:
    """Reverse the bytes of each element."""
    end -= (end - start) % size
    if size > 1 and end > start:
        swapped = np.frombuffer(content, dtype=f"<u{size}", count=(end - start) // size, offset=start)
        content[start:end] = swapped.byteswap().tobytes()
