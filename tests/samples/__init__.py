"""A sample file of every format, written from one known motion, so that the expected clip is exact.

A module here is named after the reader in kinemimic.pipeline.readers whose format it writes, and has
`files(frames) -> dict[str, bytes]`: file name -> content, the capture first, then its sidecar files.
These writers are here because only tests need them.
"""

from __future__ import annotations

import hashlib
import importlib
from pathlib import Path
from types import ModuleType

from kinemimic.pipeline.readers.base.source import Source
from kinemimic.pipeline.readers.recognise import _MODULES

READERS = tuple(name.rpartition(".")[2] for name in _MODULES)


def reader(name: str) -> ModuleType:
    """The reader whose sample has this name."""
    return importlib.import_module(f"kinemimic.pipeline.readers.{_MODULES[READERS.index(name)]}")


def source_of(text: str, path: Path) -> Source:
    """A source with text in memory."""
    content = text.encode()
    return Source(path, content, hashlib.sha256(content).hexdigest())
