"""Building the wheel and calling what it installs, with no way back to this repository."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("pipeline", "retarget", "train", "evaluate", "datasets")


def elsewhere() -> dict[str, str]:
    """The environment without what would lead back to the repository."""
    return {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL_ENV"))}


def call(*command: str | Path, folder: Path) -> str:
    """Standard output of a command that has to end well."""
    done = subprocess.run(
        [str(part) for part in command],
        cwd=folder,
        env=elsewhere(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{command}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"
    return done.stdout


def build_wheel(source: Path, out: Path) -> Path:
    """The wheel, by way of the sdist, of a copy of the sources: in the repository it would find what lies in
    build/. What the sdist lacks, the wheel lacks."""
    for name in ("api", *FOLDERS):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    call(
        sys.executable,
        "-m",
        "build",
        "--no-isolation",
        "--outdir",
        out,
        source,
        folder=out,
    )
    (built,) = out.glob("*.whl")
    return built


def install_beside(wheel: Path, venv: Path) -> Path:
    """An environment of its own with the wheel alone, and all else from the running one; its folder bin."""
    call(sys.executable, "-m", "venv", "--without-pip", venv, folder=venv.parent)
    python = venv / "bin" / "python"
    pip = (sys.executable, "-m", "pip", "--python", python)
    call(*pip, "install", "--quiet", "--no-deps", "--no-index", wheel, folder=venv.parent)
    here = Path(
        call(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", folder=venv).strip()
    )
    # A folder on the path, but none whose own .pth files are read: those lead to the repository.
    (here / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return venv / "bin"
