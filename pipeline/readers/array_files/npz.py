"""Arrays of an .npz archive, which is a ZIP of .npy files, or of one .npy file: nothing is unpickled, and
nothing is larger than it claims.
"""

from __future__ import annotations

import io
import math
import re
import zipfile
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.base.source import Source

# Bytes of one array: an hour of 55 joints at 120 Hz in double precision is half of it.
MAX_ARRAY = 2**30
_SUFFIX = ".npy"
# As numpy writes it, for arrays of numbers and words of a fixed length.
_HEADER = re.compile(
    r"\{'descr': '(?P<descr>[<>|=]?(?:f[248]|[iu][1248]|b1|[SU]\d{1,3}))', "
    r"'fortran_order': (?P<fortran>True|False), 'shape': \((?P<shape>[\d, ]*)\), \}\s*"
)
_SAVE_AS = "arrays of Python objects are not read"
# Bytes of an .npy file's mark and version, and of the longest header that numbers have.
_MARK, _LONGEST_HEADER = 8, 1024
_BEGINS = {b"\x93NUMPY\x01\x00": 10, b"\x93NUMPY\x02\x00": 12}


def array_names(source: Source) -> frozenset[str]:
    """The names of the arrays; empty for anything but an .npz archive."""
    if not source.content.startswith(b"PK\x03\x04"):
        return frozenset()
    try:
        with zipfile.ZipFile(io.BytesIO(source.content)) as archive:
            names = archive.namelist()
    except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError, EOFError):
        return frozenset()
    return frozenset(name.removesuffix(_SUFFIX) for name in names if name.endswith(_SUFFIX))


def read_arrays(source: Source, wanted: Sequence[str]) -> dict[str, NDArray[Any]]:
    """Those of the wanted arrays that the archive has.

    Raises CaptureError for a damaged archive, and for an array of Python objects or of more than MAX_ARRAY.
    """
    arrays: dict[str, NDArray[Any]] = {}
    try:
        with zipfile.ZipFile(io.BytesIO(source.content)) as archive:
            members = {info.filename: info for info in archive.infolist()}
            for name in wanted:
                info = members.get(name + _SUFFIX)
                if info is not None:
                    if info.file_size > MAX_ARRAY:
                        raise source.error(
                            expected=f"at most {MAX_ARRAY >> 20} MB in {name}",
                            found=f"{info.file_size >> 20}",
                        )
                    arrays[name] = _array(name, archive.read(info), source)
    except CaptureError:
        raise
    except (
        zipfile.BadZipFile, zlib.error, OSError, EOFError, NotImplementedError, RuntimeError, ValueError,
        MemoryError, OverflowError,
    ) as error:  # fmt: skip
        what = " ".join(str(error).split())[:80] or type(error).__name__
        raise source.error(expected="a whole .npz archive", found=f"damage ({what})") from None
    return arrays


def array_shapes(source: Source) -> dict[str, tuple[int, ...]]:
    """The shapes of the arrays of numbers or words: by name in an .npz archive, of an .npy file under "".

    Never raises: what cannot be read is left out.
    """
    heads = {"": source.content[:_LONGEST_HEADER]}
    if names := array_names(source):
        heads = {}
        with zipfile.ZipFile(io.BytesIO(source.content)) as archive:
            for name in names:
                try:
                    with archive.open(name + _SUFFIX) as file:
                        heads[name] = file.read(_LONGEST_HEADER)
                except (
                    zipfile.BadZipFile, zlib.error, OSError, EOFError, NotImplementedError, RuntimeError,
                    ValueError,
                ):  # fmt: skip
                    continue
    shapes = {}
    for name, head in heads.items():
        begin = _BEGINS.get(head[:_MARK], len(head))
        end = begin + int.from_bytes(head[_MARK:begin], "little") if begin < len(head) else begin
        if header := _HEADER.fullmatch(head[begin:end].decode("latin-1")):
            shapes[name] = _shape(header)
    return shapes


def read_array(source: Source) -> NDArray[Any]:
    """The array of an .npy file; CaptureError as in `read_arrays`."""
    return _array(source.path.stem, source.content, source)


def _shape(header: re.Match[str]) -> tuple[int, ...]:
    return tuple(int(size) for size in re.findall(r"\d{1,12}", header["shape"]))


def _array(name: str, content: bytes, source: Source) -> NDArray[Any]:
    """The array of an .npy file's bytes.

    `numpy.load` would first allocate whatever the header claims, and evaluates the header as Python.
    """
    begin = _BEGINS.get(content[:_MARK])
    if begin is None:
        raise source.error(expected=f"{name}.npy of version 1 or 2", found=f"{content[:_MARK]!r}")
    data = begin + int.from_bytes(content[_MARK:begin], "little")
    header = _HEADER.fullmatch(content[begin:data].decode("latin-1"))
    if header is None:
        raise source.error(
            expected=f"numbers or words in {name}", found=f"{content[begin:data][:50]!r}", advice=_SAVE_AS
        )
    shape = _shape(header)
    dtype, rest = np.dtype(header["descr"]), content[data:]
    if dtype.itemsize == 0 or math.prod(shape) * dtype.itemsize != len(rest):
        raise source.error(
            expected=f"{name} of shape {shape}"[:80],
            found=f"{len(rest)} bytes of {dtype}",
            advice="it is damaged",
        )
    values = np.frombuffer(rest, dtype=dtype)
    return values.reshape(shape[::-1]).T if header["fortran"] == "True" else values.reshape(shape)
