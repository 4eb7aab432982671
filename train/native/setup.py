"""Compile Bullet and the C++ code of this folder into the module kinemimic_native.

Environment variables configure the build:

KINEMIMIC_BULLET     a folder that holds Bullet's `src` (fetch.py creates one), or `system` for an installed
                     Bullet, found by pkg-config; required
KINEMIMIC_PRECISION  double (default) or single
KINEMIMIC_ARCH       native: for the processor of this machine only; unset: for every x86-64, as a wheel
                     for distribution requires
KINEMIMIC_SANITIZE   the compiler's sanitizers, for example address,undefined; unset: none
CXX                  the compiler, as usual
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
# Each of these files includes a complete library of Bullet.
BULLET_UNITS = ("btLinearMathAll.cpp", "btBulletCollisionAll.cpp", "btBulletDynamicsAll.cpp")
DOUBLE = "-DBT_USE_DOUBLE_PRECISION"

# No -ffast-math: results must be reproducible bit for bit, and NaN must be detected.
COMPILING = [
    "-std=c++17",
    "-fno-math-errno",
    "-fvisibility=hidden",
    "-fvisibility-inlines-hidden",
    "-pthread",
]
# Bullet's spatial algebra consists of many small functions, which GCC does not inline with its default
# limits; inlining them saves an eighth of the time. Traps and the sign of zero are not needed. Python's own
# flags for extensions (wrapping integers, stack protection in each small function) cost a twelfth.
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
# Assertions are enabled, the first finding ends the program, and its report has names and line numbers.
CHECKED = [
    "-O1",
    "-g",
    "-fno-omit-frame-pointer",
    "-fno-sanitize-recover=all",
    "-UNDEBUG",
    "-D_GLIBCXX_ASSERTIONS",
]


class BuildBullet(build_clib):
    """Hides Bullet's sources, which lie outside this folder, from the list of a distribution's files."""

    def get_source_files(self) -> list[str]:
        return []


def stop(reason: str) -> NoReturn:
    """Exit with one line; install.py recognises its beginning."""
    raise SystemExit(f"kinemimic-native: {reason}")


def chosen(name: str, *known: str) -> str:
    """The value of an environment variable, which must be one of the known ones; the first if it is unset."""
    value = os.environ.get(name) or known[0]
    if value not in known:
        stop(f"{name}: expected one of {', '.join(filter(None, known))}, found {value}")
    return value


def system_bullet(precision: str) -> list[str]:
    """Flags for the installed Bullet of that precision; Debian packages both, under different names."""
    for package in ("bullet-float64", "bullet"):
        command = ["pkg-config", "--cflags", "--libs", package]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603 (fixed)
        except (OSError, subprocess.CalledProcessError):
            continue
        flags = shlex.split(done.stdout)
        if (DOUBLE in flags) == (precision == "double"):
            return flags
    stop(
        f"expected an installed Bullet of {precision} precision, found none by pkg-config; install it "
        "(Debian: libbullet-dev)"
    )


def bullet_source(folder: str) -> Path:
    """The `src` folder of Bullet in the folder that KINEMIMIC_BULLET names."""
    src = Path(folder).resolve() / "src"
    if not folder or not all((src / unit).is_file() for unit in BULLET_UNITS):
        stop(
            f"KINEMIMIC_BULLET: expected `system` or a folder with Bullet's src, found {folder or 'nothing'}"
        )
    return src


def is_stale(made: str, source: str) -> bool:
    """Whether an object file is older than its sources; for our own files, these include our headers."""
    origin = [source, *(HEADERS if source in SOURCES else [])]
    return any(Path(made).stat().st_mtime < Path(path).stat().st_mtime for path in origin)


def main() -> None:
    """Build with the configuration from the environment."""
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
    # Each combination of flags has its own folder of object files, which later builds reuse.
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
