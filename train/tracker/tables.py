"""The reference tables of a library's motions, made once for a library."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.cli.progress import progress
from kinemimic.retarget.humanoid.motion import Motion
from kinemimic.retarget.library.motion_library import MotionLibrary
from kinemimic.train.reference.reference_library import ReferenceLibrary

TABLES = "references"  # folder beside a tracker's policy


def reference_tables(library: MotionLibrary, motions: NDArray[np.intp], out: Path, identity: str) -> Path:
    """Folder in `out` with the tables of these motions (N,); identity: content hash of the library."""
    folder = out / TABLES
    stamp = folder / "library"
    if not stamp.exists() or stamp.read_text() != identity:
        stamp.unlink(missing_ok=True)
        with progress("references", len(motions), unit="motions") as bar:

            def each() -> Iterator[Motion]:
                for index in motions:
                    yield library.motion(int(index))
                    bar.advance(1)

            ReferenceLibrary(each()).save(folder)
        stamp.write_text(identity)
    return folder
