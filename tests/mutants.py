"""Which mutations of the code no test notices: `make mutants PACKAGES="train/ppo retarget/strides"`.

Each package is mutated in a copy of the working tree (build/mutants) by cosmic-ray, one change at a time, and
tested by the tests that mirror it. What survives is listed with its place; it takes hours for all packages.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COPY = ROOT / "build" / "mutants"
FOLDERS = ("pipeline", "retarget", "train", "evaluate", "datasets")
# The core: what every score depends on.
PACKAGES = (
    "pipeline/kinematics",
    "pipeline/filters",
    "retarget/strides",
    "retarget/feet",
    "retarget/optimise",
    "train/task",
    "train/ppo",
    "evaluate/scoring",
)
# A mutation may loop for ever.
SECONDS = 300
CONFIG = """[cosmic-ray]
module-path = "{package}"
timeout = {seconds}.0
excluded-modules = ["{package}/__init__.py"]
test-command = "{python} -m pytest -x -q -p no:cacheprovider -m 'not slow' tests/{package}"
[cosmic-ray.distributor]
name = "local"
"""


def copied() -> dict[str, str]:
    """A copy of what git knows of the working tree, and the environment in which it is imported."""
    shutil.rmtree(COPY, ignore_errors=True)
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    for name in files.stdout.decode().split("\0"):
        if name and (ROOT / name).is_file():
            (COPY / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, COPY / name)
    package = COPY / "package" / "kinemimic"
    package.mkdir(parents=True)
    for folder in FOLDERS:
        (package / folder).symlink_to(COPY / folder)
    return {**os.environ, "PYTHONPATH": str(package.parent), "OMP_NUM_THREADS": "1"}


def survivors(package: str, environment: dict[str, str]) -> None:
    """Mutate one package and print what survived."""
    config, session = COPY / "mutants.toml", COPY / f"{package.replace('/', '-')}.sqlite"
    config.write_text(CONFIG.format(package=package, seconds=SECONDS, python=sys.executable))
    tool = str(Path(sys.executable).with_name("cosmic-ray"))
    for step in ("baseline", "init", "exec"):
        files = [config] if step == "baseline" else [config, session]
        subprocess.run([tool, step, *map(str, files)], cwd=COPY, env=environment, check=True)
    print(f"# {package}", flush=True)
    report = str(Path(sys.executable).with_name("cr-report"))
    subprocess.run([report, "--surviving-only", "--show-diff", str(session)], cwd=COPY, check=True)


def main() -> None:
    """The packages named in the arguments, or all of PACKAGES."""
    packages = sys.argv[1:] or PACKAGES
    environment = copied()
    for package in packages:
        survivors(package, environment)


if __name__ == "__main__":
    main()
