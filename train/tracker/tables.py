"""The reference tables of a library's motions, made once for a library."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.files.provenance import versions
from kinemimic.pipeline.files.store import write_text
from kinemimic.pipeline.parallel.task_pool import parallel_map
from kinemimic.retarget.library.motion_library import MotionLibrary
from kinemimic.train.reference.reference_library import LIBRARY_TABLE_RATE, ReferenceLibrary

TABLES = "references"  # folder beside a tracker's policy
CHUNK = 20  # motions of a task


def reference_tables(library: MotionLibrary, motions: NDArray[np.intp], out: Path, identity: str) -> Path:
    """Folder in `out` with the tables of these motions (N,); identity: content hash of the library.

    Tables that are there are kept if they are of these motions, and made by this version.
    """
    folder = out / TABLES
    stamp = folder / "library"
    made = json.dumps([identity, motions.tolist(), LIBRARY_TABLE_RATE, versions().get("kinemimic")])
    if not stamp.exists() or stamp.read_text(errors="replace") != made:
        stamp.unlink(missing_ok=True)
        parts = [motions[k : k + CHUNK] for k in range(0, len(motions), CHUNK)]
        tasks = [[library.motion(int(index)) for index in part] for part in parts]
        with progress("references", len(tasks), unit=f"chunks of {CHUNK}") as bar:
            ReferenceLibrary.joined(parallel_map(ReferenceLibrary, tasks, progress=bar.advance)).save(folder)
        write_text(stamp, made)
    return folder
