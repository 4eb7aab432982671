"""A sample file of every format, written from one known motion, so that the expected clip is exact.

A module here is named after the reader in kinemimic.pipeline.readers whose format it writes, and has
`files(frames) -> dict[str, bytes]`: file name -> content, the capture first, then its sidecar files.
These writers are here because only tests need them.
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path
from types import ModuleType

from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.recognise import readers


def reader_modules() -> dict[str, ModuleType]:
    """Name of a sample -> the reader of its format, in the order in which readers are tried."""
    modules = [sys.modules[reader.__name__] for reader in readers()]  # type: ignore[attr-defined]
    return {module.__name__.rpartition(".")[2]: module for module in modules}


def reader(name: str) -> ModuleType:
    """The reader whose sample has this name."""
    return reader_modules()[name]


def source_of(text: str, path: Path) -> Source:
    """A source with text in memory."""
    content = text.encode()
    return Source(path, content, hashlib.sha256(content).hexdigest())
