"""pybullet, brought in without the line that it prints, and its axes.

Inside Bullet the axes are X left, Y up, Z forward (see `retarget/urdf.py`): a cyclic change of components,
done at the border of the files that use this one.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

TO_BULLET = [1, 2, 0]
QUAT_TO_BULLET = [1, 2, 0, 3]
FROM_BULLET = [2, 0, 1]
QUAT_FROM_BULLET = [2, 0, 1, 3]


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep pybullet's build line, printed by its C code on import, off the terminal."""
    sys.stderr.flush()
    saved, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)
    try:
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)


with _quiet():
    import pybullet as bullet

__all__ = ["FROM_BULLET", "QUAT_FROM_BULLET", "QUAT_TO_BULLET", "TO_BULLET", "bullet"]
