"""Compiles kinemimic-native for this machine and installs it beside the Python that runs this.

    python install.py fetched|system STAMP

`fetched` takes Bullet's sources from the package index (fetch.py), `system` an installed Bullet. STAMP is a
file that is made when the extension is installed and loads. Without a compiler or sources the project runs on
pybullet: that is no error, so one line says what is missing and what it costs, and the exit status is 0.
"""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

from fetch import FetchError, fetch

HERE = Path(__file__).resolve().parent
BUILD = HERE.parents[1] / "build"
LOG = BUILD / "native.log"
COST = "training runs on pybullet, about 3 times slower"


class MissingError(Exception):
    """What keeps the extension from being built, and what to do about it: two arguments, in all one line."""


def compiler() -> str:
    """The command of a C++ compiler: CXX, else the one that Python was built with, else what is usual."""
    if named := os.environ.get("CXX"):
        candidates = [named]
    else:
        candidates = [sysconfig.get_config_var("CXX") or "c++", "c++", "g++", "clang++"]
    for command in candidates:
        if shutil.which((shlex.split(command) or [""])[0]):
            return command
    tried = ", ".join(dict.fromkeys(candidates))
    raise MissingError(f"no C++ compiler found ({tried})", "install one (Debian: apt install g++)")


def first_error(log: str) -> str:
    """The line of a build's output that says most: the compiler's or the linker's first error, else pip's."""
    lines = [line.strip() for line in log.splitlines()]
    for mark in ("kinemimic-native:", "error: ", "ERROR: ", "Error: "):
        for line in lines:
            if mark in line:
                return line[:200]
    return "no reason was given"


def call(*arguments: str, environment: dict[str, str]) -> None:
    """Run this Python, its output to the log; MissingError with the line that matters when it fails."""
    command = [sys.executable, *arguments]
    done = subprocess.run(  # noqa: S603 (our own words)
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    with LOG.open("a", encoding="utf-8") as log:
        log.write(f"$ {shlex.join(command)}\n{done.stdout}")
    if done.returncode:
        raise MissingError(first_error(done.stdout), f"mend that ({os.path.relpath(LOG)} has all of it)")


def install(bullet: str) -> None:
    """Fetch, compile, install, and see that it loads; MissingError when one of them cannot be."""
    environment = {**os.environ, "CXX": compiler(), "KINEMIMIC_ARCH": "native"}
    try:
        environment["KINEMIMIC_BULLET"] = bullet if bullet == "system" else str(fetch(BUILD))
    except (FetchError, OSError) as error:
        remedy = "look at the network, or take an installed Bullet (BULLET=system)"
        raise MissingError(str(error), remedy) from None
    BUILD.mkdir(exist_ok=True)
    LOG.unlink(missing_ok=True)
    # Without isolation it is the pinned pybind11 that compiles; forced, because the version stays the same.
    options = ["--verbose", "--no-deps", "--no-build-isolation", "--force-reinstall"]
    call("-m", "pip", "install", *options, str(HERE), environment=environment)
    call("-c", "import kinemimic_native", environment=environment)


def main() -> int:
    """The command: exit status 0, whether the extension is there now or a line says why not."""
    parser = argparse.ArgumentParser(description="Compiles and installs the native engine, if this can be.")
    parser.add_argument("bullet", choices=("fetched", "system"))
    parser.add_argument("stamp", type=Path)
    options = parser.parse_args()
    options.stamp.unlink(missing_ok=True)
    try:
        install(options.bullet)
    except MissingError as missing:
        reason, remedy = missing.args
        # What an earlier build left is not what the sources say now.
        uninstall = [sys.executable, "-m", "pip", "uninstall", "--quiet", "--yes", "kinemimic-native"]
        subprocess.run(uninstall, capture_output=True, check=False)  # noqa: S603
        print(f"native engine left out: {reason}; {COST}; {remedy}, then `make setup` again", file=sys.stderr)
        return 0
    options.stamp.touch()
    return 0


if __name__ == "__main__":
    sys.exit(main())
