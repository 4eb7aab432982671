"""The built wheel: what is in it, and that it gets on with Hugging Face's `datasets` and `evaluate`."""

from __future__ import annotations

import json
import sys
import zipfile
from pathlib import Path

import pytest
from peers.wheels import FOLDERS, ROOT, call

# Modules of every folder, and after them what bears their names elsewhere.
IMPORTS = """
import importlib, sys
folder = sys.argv[1]
for name in (
    "pipeline.kinematics.rotations",
    "retarget.humanoid.body",
    "train.rollout.trajectory",
    "evaluate.workflow.run",
):
    module = importlib.import_module("kinemimic." + name)
    assert module.__file__.startswith(folder), module
import datasets, evaluate
for module in (datasets, evaluate):
    assert module.__file__.startswith(folder) and "kinemimic" not in module.__file__, module
assert not {"pipeline", "retarget", "train"} & set(sys.modules)
"""


def test_the_wheel_holds_the_package_and_nothing_else(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    inside = [name for name in names if ".dist-info/" not in name]
    assert {name.split("/")[0] for name in inside} == {"kinemimic"}
    assert {name.split("/")[1] for name in inside} == {*FOLDERS, "__init__.py", "__main__.py", "py.typed"}
    assert not any("tests/" in name or "/test_" in name for name in inside)
    # The versioned data set and the comparison's networks (2.8 MB) stay in the repository.
    data = {
        f"kinemimic/{path.relative_to(ROOT)}"
        for path in (ROOT / "datasets").rglob("*.*")
        if not {"versions", "comparison"} & set(path.relative_to(ROOT).parts)
    }
    assert "kinemimic/datasets/policies/recipes.toml" in data
    assert "kinemimic/datasets/scenarios/pull-forward.toml" in data
    assert data == {name for name in inside if name.startswith("kinemimic/datasets/")}


def test_the_wheel_holds_every_source_file(wheel: Path) -> None:
    files = {
        path.relative_to(ROOT) for name in FOLDERS for path in (ROOT / name).rglob("*") if _is_source(path)
    }
    # train/native is a distribution of its own, and these files are what compiles it.
    sources = {f"kinemimic/{path}" for path in files if path.parts[:2] != ("train", "native")}
    assert "kinemimic/pipeline/cli/templates/page.css" in sources
    sources |= {f"kinemimic/{path.name}" for path in (ROOT / "api").glob("*.py")}
    assert sources == {name for name in zipfile.ZipFile(wheel).namelist() if _is_source(Path(name))}


def _is_source(path: Path) -> bool:
    """Whether a file is a module or belongs to the templates of the reports."""
    return path.suffix == ".py" or path.parent.name == "templates"


def test_the_wheel_installs_a_console_script_and_the_licence(wheel: Path) -> None:
    archive = zipfile.ZipFile(wheel)
    (entry_points,) = (name for name in archive.namelist() if name.endswith("entry_points.txt"))
    assert "kinemimic = kinemimic.pipeline.cli.main:main" in archive.read(entry_points).decode()
    assert any(name.endswith("licenses/LICENSE") for name in archive.namelist())


def test_it_imports_beside_packages_of_the_same_names(wheel: Path, tmp_path: Path) -> None:
    target = tmp_path / "site"
    call(
        sys.executable,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--no-deps",
        "--no-index",
        "--target",
        target,
        wheel,
        folder=tmp_path,
    )
    for name in ("datasets", "evaluate"):
        (target / name).mkdir()
        (target / name / "__init__.py").write_text("")
    first = f"import sys; sys.path.insert(0, {str(target)!r})"
    call(sys.executable, "-c", f"{first}\n{IMPORTS}", target, folder=tmp_path)


@pytest.mark.slow
def test_an_empty_environment_with_hugging_face_runs_the_whole_way(wheel: Path, tmp_path: Path) -> None:
    """Installs from the package index: the constraints' versions, `datasets` and `evaluate`."""
    venv = tmp_path / "venv"
    call(sys.executable, "-m", "venv", venv, folder=tmp_path)
    python = venv / "bin" / "python"
    pip = (python, "-m", "pip", "install", "--quiet", "-c", ROOT / "constraints.txt")
    call(*pip, "torch==2.13.0", folder=tmp_path)
    call(*pip, wheel, "datasets", "evaluate", folder=tmp_path)
    call(python, "-c", IMPORTS, venv, folder=tmp_path)
    out = call(venv / "bin" / "kinemimic", "run", "--budget", "2000", "--json", folder=tmp_path)
    assert json.loads(out)["scores"]["capture"]["simulated"] is True
    for name in ("scores.json", "report.html", "view.rrd"):
        assert (tmp_path / "runs" / "default" / name).is_file()
