"""pybullet, imported without its build line, and the conversion to its axes.

In Bullet the axes are X left, Y up, Z forward (see `retarget/formats/urdf.py`): a cyclic permutation of
components, applied in the modules that import this one.
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
    """Suppress pybullet's build line, which its C code prints on import."""
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
