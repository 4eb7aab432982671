"""`import kinemimic`: public names on first use, and runs as objects."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from typing import get_type_hints

import pytest

import kinemimic as km
from kinemimic.evaluate.workflow import run_object
from kinemimic.pipeline.virtual_kinect.recorder import record_virtual


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A walk recorded by the virtual Kinect."""
    folder = tmp_path_factory.mktemp("virtual")
    record_virtual(folder, seed=0)
    return folder / "kinect_walk.skl"


def test_every_public_name_can_be_imported() -> None:
    assert set(dir(km)) == {*km.__all__, "__version__"}
    for name in km.__all__:
        assert getattr(km, name).__name__ == name
    assert km.__version__ == version("kinemimic")
    with pytest.raises(AttributeError, match="nosuch"):
        _ = km.nosuch


def test_importing_loads_nothing_heavy() -> None:
    code = "import sys, kinemimic; print(*{'numpy', 'torch', 'scipy', 'click', 'pandas'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == ""


def test_the_module_is_the_command_line() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "kinemimic", "--version"], check=True, capture_output=True, text=True
    )
    assert version("kinemimic") in done.stdout


@pytest.mark.parametrize("name", ["ingest", "retarget", "train", "evaluate"])
def test_a_stage_takes_what_its_function_takes(name: str) -> None:
    """The methods repeat the functions' parameters, for editors; none may be missing or have another type."""
    module = {
        "ingest": "kinemimic.pipeline.ingest",
        "retarget": "kinemimic.retarget.command",
        "train": "kinemimic.train.command",
        "evaluate": "kinemimic.evaluate.scoring.evaluate",
    }[name]
    function = getattr(__import__(module, fromlist=[name]), name)
    expected = get_type_hints(function)
    found = get_type_hints(getattr(km.Run, name))
    assert expected.pop("run") is Path
    if name == "ingest":
        assert expected.pop("capture") is Path
        assert found.pop("capture") == str | Path
    assert found == expected


def test_the_stages_of_a_run(simulated: Path, tmp_path: Path) -> None:
    walk = km.Run(tmp_path / "walk")
    assert repr(walk) == f"Run('{tmp_path / 'walk'}'): no capture yet, no motion yet"
    clip = walk.ingest(simulated)
    assert re.fullmatch(r"Clip\([\d,]+ frames in [\d.]+ s, 20 joints, .*, simulated\)", repr(clip))
    assert "no motion yet" in repr(walk)
    walk.convert()
    assert walk.clip.rotations is not None
    motion = walk.retarget()
    assert motion.identity == walk.motion.identity
    assert re.fullmatch(r"Motion\(a loop, [\d.]+ s, [\d.]+ m/s, simulated\)", repr(motion))
    assert repr(walk).endswith(f"{simulated.name}, {motion!r}, no scores yet")
    (written,) = walk.export(["bvh"], what=["reference"])
    assert written.suffix == ".bvh" and written.is_file()
    with pytest.raises(km.KinemimicError, match=r"scores\.json"):
        _ = walk.scores


def test_run_skips_what_is_up_to_date(simulated: Path, tmp_path: Path) -> None:
    stages = run_object.RUN_STAGES[:3]
    first = km.run(simulated, tmp_path / "walk", stages=stages)
    made = (first.folder / "motion.json").stat().st_mtime_ns
    again = km.run(str(simulated), tmp_path / "walk", stages=stages)
    assert (again.folder / "motion.json").stat().st_mtime_ns == made
