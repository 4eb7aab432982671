"""The data set of this repository: manifest, dvc's lock and committed files agree."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import pytest
import yaml

from kinemimic.pipeline.files.canonical import Canonical
from kinemimic.retarget.versions.build import STAGES, build_capture, built_path
from kinemimic.retarget.versions.manifest import Manifest, changed_raw, missing_changelog_line
from kinemimic.retarget.versions.params import PARAMS, Params

ROOT = Path(__file__).resolve().parents[3]
LOCK: dict[str, Any] = yaml.safe_load((ROOT / "dvc.lock").read_text())["stages"]
PARAMETERS = Params.load(PARAMS, ROOT)
MANIFEST = Manifest.load(ROOT / PARAMS.parent / "manifest.json")


def test_raw_files_version_and_changelog() -> None:
    assert list(changed_raw(PARAMETERS, MANIFEST, ROOT)) == []
    assert MANIFEST.version == PARAMETERS.version
    assert missing_changelog_line(PARAMETERS.version, ROOT) is None


def test_the_lock_contains_every_stage() -> None:
    stages = {f"{stage}@{name}" for stage in STAGES for name in PARAMETERS.captures}
    assert LOCK.keys() == stages | {f"score@{name}" for name in PARAMETERS.policies}


@pytest.mark.parametrize("name", PARAMETERS.captures)
def test_the_data_built_today_are_those_locked(name: str, tmp_path: Path) -> None:
    for (stage, file), made in zip(
        STAGES.items(), build_capture(PARAMETERS.capture(name), ROOT).values(), strict=True
    ):
        (out,) = LOCK[f"{stage}@{name}"]["outs"]
        assert out["path"] == built_path(PARAMETERS, Path(), name, file).as_posix()
        made.write(tmp_path / file)
        content = (tmp_path / file).read_bytes()
        assert (out["size"], out["md5"]) == (len(content), hashlib.md5(content).hexdigest())
        assert made.identity == MANIFEST.content[f"{name}/{file}"]


@pytest.mark.parametrize("name", PARAMETERS.captures)
def test_the_committed_motion_is_the_locked_one(name: str) -> None:
    committed = Canonical.read(built_path(PARAMETERS, ROOT, name, "motion.json"))
    assert committed.identity == MANIFEST.content[f"{name}/motion.json"]


@pytest.mark.parametrize("name", PARAMETERS.policies)
def test_the_committed_scores_are_the_locked_ones(name: str) -> None:
    (out,) = LOCK[f"score@{name}"]["outs"]
    content = (ROOT / out["path"]).read_bytes()
    assert out["md5"] == hashlib.md5(content).hexdigest()
