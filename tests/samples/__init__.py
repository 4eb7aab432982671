"""A file of every format, written from one known motion: what readers must give back is known exactly.

A module here is named after the reader in kinemimic.pipeline.readers whose format it writes, and has
`files(frames) -> dict[str, bytes]`: file name -> content, the capture first, then the files that must lie
beside it. The formats' writers live here, because only tests need them.
"""

from __future__ import annotations

import importlib
from types import ModuleType

from kinemimic.pipeline.readers.recognise import _MODULES

READERS = tuple(name.rpartition(".")[2] for name in _MODULES)


def reader(name: str) -> ModuleType:
    """The reader whose sample has this name."""
    return importlib.import_module(f"kinemimic.pipeline.readers.{_MODULES[READERS.index(name)]}")
