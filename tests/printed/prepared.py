"""What a page's folder holds before its first command, as the page's reader would have it."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from printed.blocks import ROOT, blocks
from samples import described, depth_scene

# What the workshop (conftest.py) made, by the names that the pages give it.
_FROM_WORKSHOP = {
    "walk.skl": "runs/walk/capture/kinect_walk.skl",
    "runs/walk": "runs/walk",
}


def _copied(name: str) -> Callable[[Path, Path], None]:
    def prepare(folder: Path, workshop: Path) -> None:
        source, target = workshop / _FROM_WORKSHOP[name], folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        (shutil.copytree if source.is_dir() else shutil.copy)(source, target)

    return prepare
