"""Whether a file was made from the motion beside it."""

from __future__ import annotations

from pathlib import Path

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.run_folder.consistency import command
from kinemimic.retarget.humanoid.motion import Motion


def require_same_motion(path: Path, stated: object, motion: Motion, *, stage: str) -> None:
    """KinemimicError if a file of a run folder states the identity of another motion.

    stated: `Motion.identity` in the file, None in the files of earlier versions; stage: what writes the file.
    """
    if stated not in (None, motion.identity):
        raise KinemimicError(
            f"{path}: expected results of the motion in this folder, found those of another motion; "
            f"run `{command(stage, path.parent)}` again"
        )
