"""Realistic and worse damage of files, which readers must survive."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

_NUMBER = re.compile(rb"[-+]?[0-9][0-9.eE+-]*")
_HUGE = (b"1e308", b"-1e308", b"1e999", b"99999999999999999999", b"4294967296", b"1000000000", b"-1", b"0")
_ODD = (
    b"nan",
    b"NaN",
    b"-inf",
    b"1_000",
    b"0x10",
    b"1,5",
    b"--1",
    b"1e",
    b".",
    b"''",
    b'"',
    b"\xff\xfe",
    b"None",
)
_JUNK = (
    b"\x00",
    b"\x1a",
    b"\xef\xbb\xbf",
    b"{",
    b"}",
    b"[",
    b"]",
    b"\t",
    b"\n\n\n",
    b";;;",
    b",,",
    b"#",
    b"\r",
)


def _cut(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: int(rng.integers(0, len(data)))]


def _behead(data: bytes, rng: np.random.Generator) -> bytes:
    return data[int(rng.integers(0, len(data))) :]


def _flip(data: bytes, rng: np.random.Generator) -> bytes:
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 9))):
        out[int(rng.integers(len(out)))] ^= 1 << int(rng.integers(8))
    return bytes(out)


def _span(data: bytes, rng: np.random.Generator, most: int = 200) -> slice:
    start = int(rng.integers(0, len(data)))
    return slice(start, start + int(rng.integers(1, most)))


def _delete(data: bytes, rng: np.random.Generator) -> bytes:
    span = _span(data, rng)
    return data[: span.start] + data[span.stop :]


def _repeat(data: bytes, rng: np.random.Generator) -> bytes:
    span = _span(data, rng)
    return data[: span.stop] + data[span] * int(rng.integers(1, 40)) + data[span.stop :]


def _insert(data: bytes, rng: np.random.Generator) -> bytes:
    at = int(rng.integers(0, len(data)))
    return data[:at] + _JUNK[int(rng.integers(len(_JUNK)))] * int(rng.integers(1, 6)) + data[at:]


def _binary(data: bytes, rng: np.random.Generator) -> bytes:
    at = int(rng.integers(0, len(data)))
    return data[:at] + rng.bytes(int(rng.integers(1, 300))) + data[at:]


def _tokens(data: bytes, rng: np.random.Generator, words: tuple[bytes, ...], head: bool) -> bytes:
    """Replace one to three numbers, anywhere or in the first 300 bytes, where counts stand."""
    out = data
    for _ in range(int(rng.integers(1, 4))):
        limit = min(len(out), 300) if head else len(out)
        start = int(rng.integers(0, max(limit, 1)))
        match = _NUMBER.search(out, start)
        if match:
            out = out[: match.start()] + words[int(rng.integers(len(words)))] + out[match.end() :]
    return out


def _huge(data: bytes, rng: np.random.Generator) -> bytes:
    return _tokens(data, rng, _HUGE, head=False)


def _count(data: bytes, rng: np.random.Generator) -> bytes:
    return _tokens(data, rng, _HUGE, head=True)


def _odd(data: bytes, rng: np.random.Generator) -> bytes:
    return _tokens(data, rng, _ODD, head=False)


def _lines(data: bytes, rng: np.random.Generator) -> bytes:
    """Drop, double or exchange lines."""
    lines = data.split(b"\n")
    a, b = (int(rng.integers(len(lines))) for _ in range(2))
    match int(rng.integers(3)):
        case 0:
            del lines[a]
        case 1:
            lines.insert(b, lines[a])
        case _:
            lines[a], lines[b] = lines[b], lines[a]
    return b"\n".join(lines)


def _deep(data: bytes, rng: np.random.Generator) -> bytes:
    """Nesting as deep as a parser's stack, and deeper."""
    opening = (b"[", b"{", b'{"a":', b"JOINT a {", b"((")[int(rng.integers(5))]
    at = int(rng.integers(0, len(data)))
    return data[:at] + opening * int(rng.choice([50, 2_000, 100_000])) + data[at:]


def _joined(data: bytes, rng: np.random.Generator) -> bytes:
    """One very long line."""
    return data.replace(b"\n", b" " if rng.integers(2) else b"")


MUTATIONS: tuple[Callable[[bytes, np.random.Generator], bytes], ...] = (
    _cut, _behead, _flip, _delete, _repeat, _insert, _binary, _huge, _count, _odd, _lines, _deep, _joined,
)  # fmt: skip


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """One to three mutations of a file's bytes; never nothing at all."""
    for _ in range(int(rng.integers(1, 4))):
        data = MUTATIONS[int(rng.integers(len(MUTATIONS)))](data, rng) or b" "
    return data
