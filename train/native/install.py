"""Compile kinemimic-native for this machine and install it for the Python that runs this script.

    python install.py fetched|system STAMP

`fetched` uses Bullet's sources from the package index (fetch.py), `system` an installed Bullet. STAMP is a
file that is created once the extension is installed and can be imported. Without a compiler or sources, the
project runs on pybullet. This is not an error: one line states what is missing and the consequence, and the
exit status is 0.
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
COST = "training runs on pybullet, about 3.5 times slower"


class MissingError(Exception):
    """Why the extension cannot be built, and what to do about it: two arguments that form one line."""


def compiler() -> str:
    """The command of a C++ compiler: CXX, else the one that Python was built with, else a common one."""
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
    """The most informative line of a build's output: the compiler's or linker's first error, else pip's."""
    lines = [line.strip() for line in log.splitlines()]
    for mark in ("kinemimic-native:", "error: ", "ERROR: ", "Error: "):
        for line in lines:
            if mark in line:
                return line[:200]
    return "no reason was given"


def call(*arguments: str, environment: dict[str, str]) -> None:
    """Run this Python and log its output; on failure, raise MissingError with the relevant line."""
    command = [sys.executable, *arguments]
    done = subprocess.run(  # noqa: S603 (fixed arguments)
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    with LOG.open("a", encoding="utf-8") as log:
        log.write(f"$ {shlex.join(command)}\n{done.stdout}")
    if done.returncode:
        raise MissingError(first_error(done.stdout), f"fix that ({os.path.relpath(LOG)} has the full output)")


def install(bullet: str) -> None:
    """Fetch, compile, install and test the import; MissingError if a step fails."""
    environment = {**os.environ, "CXX": compiler(), "KINEMIMIC_ARCH": "native"}
    try:
        environment["KINEMIMIC_BULLET"] = bullet if bullet == "system" else str(fetch(BUILD))
    except (FetchError, OSError) as error:
        remedy = "check the network connection, or use an installed Bullet (BULLET=system)"
        raise MissingError(str(error), remedy) from None
    BUILD.mkdir(exist_ok=True)
    LOG.unlink(missing_ok=True)
    # Without isolation, the pinned pybind11 is used; forced, because the version number does not change.
    options = ["--verbose", "--no-deps", "--no-build-isolation", "--force-reinstall"]
    call("-m", "pip", "install", *options, str(HERE), environment=environment)
    call("-c", "import kinemimic_native", environment=environment)


def main() -> int:
    """Run the command; the exit status is 0 even if the extension could not be built."""
    parser = argparse.ArgumentParser(description="Compile and install the native engine if possible.")
    parser.add_argument("bullet", choices=("fetched", "system"))
    parser.add_argument("stamp", type=Path)
    options = parser.parse_args()
    options.stamp.unlink(missing_ok=True)
    try:
        install(options.bullet)
    except MissingError as missing:
        reason, remedy = missing.args
        # An extension from an earlier build would not match the current sources.
        uninstall = [sys.executable, "-m", "pip", "uninstall", "--quiet", "--yes", "kinemimic-native"]
        subprocess.run(uninstall, capture_output=True, check=False)  # noqa: S603
        line = f"native engine not built: {reason}; {COST}; {remedy}, then run `make setup` again"
        print(line, file=sys.stderr)
        return 0
    options.stamp.touch()
    return 0


if __name__ == "__main__":
    sys.exit(main())
