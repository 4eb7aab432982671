"""Compiles Bullet and the C++ of this folder into the one module kinemimic_native.

What may differ between builds comes from the environment:

KINEMIMIC_BULLET     a folder that holds Bullet's `src` (fetch.py makes one), or `system` for an installed
                     Bullet, found by pkg-config; required
KINEMIMIC_PRECISION  double, or single; unset: double
KINEMIMIC_ARCH       native: for the processor of this machine, which no other may be able to run;
                     unset: for every x86-64, as a wheel that is shared has to be
KINEMIMIC_SANITIZE   the compiler's sanitizers, as in address,undefined; unset: none
CXX                  the compiler, as everywhere
"""

from __future__ import annotations

import hashlib
import os
import shlex
import subprocess
from pathlib import Path
from typing import NoReturn

from pybind11.setup_helpers import ParallelCompile, Pybind11Extension
from setuptools import setup
from setuptools.command.build_clib import build_clib

HERE = Path(__file__).resolve().parent
SOURCES = sorted(path.name for path in HERE.glob("*.cpp"))
HEADERS = sorted(path.name for path in HERE.glob("*.hpp"))
# Each includes one of Bullet's libraries whole.
BULLET_UNITS = ("btLinearMathAll.cpp", "btBulletCollisionAll.cpp", "btBulletDynamicsAll.cpp")
DOUBLE = "-DBT_USE_DOUBLE_PRECISION"

# No -ffast-math: results have to repeat bit by bit, and NaN has to be seen.
COMPILING = [
    "-std=c++17",
    "-fno-math-errno",
    "-fvisibility=hidden",
    "-fvisibility-inlines-hidden",
    "-pthread",
]
# Bullet's spatial algebra is many small functions, which GCC's own limits leave out of line: an eighth of
# the time. No trap and no sign of zero is ever asked for, and what Python's own build asks of every extension
# (wrapping integers, guards on the stack of each small function) costs a twelfth.
FAST = [
    "-O3",
    "-fno-wrapv",
    "-fno-stack-protector",
    "-g0",
    "-DNDEBUG",
    "-fno-trapping-math",
    "-fno-signed-zeros",
    *("--param", "max-inline-insns-auto=300"),
    *("--param", "inline-unit-growth=300"),
    *("--param", "large-function-growth=600"),
]
# Assertions live, the first finding ends the program, and its report has names and lines.
CHECKED = [
    "-O1",
    "-g",
    "-fno-omit-frame-pointer",
    "-fno-sanitize-recover=all",
    "-UNDEBUG",
    "-D_GLIBCXX_ASSERTIONS",
]


class BuildBullet(build_clib):
    """Bullet's units lie outside this folder, where the list of a distribution's files may not reach."""

    def get_source_files(self) -> list[str]:
        return []


def stop(reason: str) -> NoReturn:
    """End with one line; install.py looks for its beginning."""
    raise SystemExit(f"kinemimic-native: {reason}")


def chosen(name: str, *known: str) -> str:
    """An environment variable that has to be one of the known values; unset, it is the first."""
    value = os.environ.get(name) or known[0]
    if value not in known:
        stop(f"{name} has to be one of {', '.join(filter(None, known))}, and is {value}")
    return value


def system_bullet(precision: str) -> list[str]:
    """Flags for the installed Bullet of that precision; Debian has both, by two names."""
    for package in ("bullet-float64", "bullet"):
        command = ["pkg-config", "--cflags", "--libs", package]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603 (our own)
        except (OSError, subprocess.CalledProcessError):
            continue
        flags = shlex.split(done.stdout)
        if (DOUBLE in flags) == (precision == "double"):
            return flags
    stop(f"pkg-config finds no Bullet of {precision} precision: install it (Debian: libbullet-dev)")


def bullet_source(folder: str) -> Path:
    """Bullet's `src` in the folder that KINEMIMIC_BULLET names."""
    src = Path(folder).resolve() / "src"
    if not folder or not all((src / unit).is_file() for unit in BULLET_UNITS):
        stop(
            f"KINEMIMIC_BULLET has to be `system` or a folder with Bullet's src, and is {folder or 'not set'}"
        )
    return src


def is_stale(made: str, source: str) -> bool:
    """Whether an object file is older than what it was made from; our own files include our headers too."""
    origin = [source, *(HEADERS if source in SOURCES else [])]
    return any(Path(made).stat().st_mtime < Path(path).stat().st_mtime for path in origin)


def main() -> None:
    """Build for what the environment says."""
    bullet = os.environ.get("KINEMIMIC_BULLET", "")
    precision = chosen("KINEMIMIC_PRECISION", "double", "single")
    sanitizers = [f"-fsanitize={names}"] if (names := os.environ.get("KINEMIMIC_SANITIZE")) else []
    flags = [*COMPILING, *(CHECKED if sanitizers else FAST), *sanitizers]
    flags += ["-march=native"] if chosen("KINEMIMIC_ARCH", "", "native") else []
    flags += [DOUBLE] if precision == "double" else []
    linking = ["-pthread", *sanitizers]
    libraries = []
    if bullet == "system":
        found = system_bullet(precision)
        headers = [flag.replace("-I", "-isystem", 1) for flag in found if flag.startswith("-I")]
        linking += [flag for flag in found if flag.startswith(("-L", "-l"))]
    else:
        src = bullet_source(bullet)
        headers = [f"-isystem{src}"]
        units = [str(src / unit) for unit in BULLET_UNITS]
        libraries = [("bullet", {"sources": units, "cflags": [*flags, "-w", f"-I{src}"]})]
    # Object files of other flags are other files, so that each kind of build finds its own again.
    kind = hashlib.sha256(repr((headers, flags, os.environ.get("CXX"))).encode()).hexdigest()[:8]
    made = HERE.parents[1] / "build" / "native" / kind
    made.mkdir(parents=True, exist_ok=True)
    os.chdir(HERE)
    with ParallelCompile(default=len(os.sched_getaffinity(0)), needs_recompile=is_stale):
        setup(
            cmdclass={"build_clib": BuildBullet},
            options={"build": {"build_base": str(made)}, "egg_info": {"egg_base": str(made)}},
            libraries=libraries,
            ext_modules=[
                Pybind11Extension(
                    "kinemimic_native",
                    SOURCES,
                    depends=HEADERS,
                    extra_compile_args=[*flags, "-Wall", "-Wextra", *headers],
                    extra_link_args=linking,
                )
            ],
        )


main()
