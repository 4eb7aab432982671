"""Run folders for short trainings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from kinemimic.pipeline.files.store import write_text
from kinemimic.retarget.formats.motion_json import motion_to_json
from kinemimic.retarget.humanoid.motion import Motion


@pytest.fixture
def fresh(tmp_path: Path, walk: Motion) -> Callable[[str], Path]:
    """Makes run folders of a short single performance."""

    def make(name: str) -> Path:
        write_text(tmp_path / name / "motion.json", motion_to_json(replace(walk, cyclic=False)))
        return tmp_path / name

    return make
