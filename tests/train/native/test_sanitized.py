"""The extension's own tests once more, with every access to memory and every undefined operation watched."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import install
import pytest
from fetch import FetchError, fetch

ROOT = Path(__file__).resolve().parents[3]
TESTS = [
    *sorted((ROOT / "tests" / "train" / "sim").glob("test_*.py")),
    ROOT / "tests" / "train" / "task" / "test_variation.py",
]


@pytest.fixture(scope="module")
def runtime() -> str:
    """What is loaded before Python: the sanitizers, and the C++ library whose exceptions they follow."""
    try:
        compiler = install.compiler()
    except install.MissingError as missing:
        pytest.skip(str(missing.args[0]))
    found = []
    for library in ("libasan.so", "libubsan.so", "libstdc++.so"):
        command = [*compiler.split(), f"-print-file-name={library}"]
        path = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
        if not Path(path).is_absolute():
            pytest.skip(f"{compiler} has no {library}")
        found.append(path)
    return " ".join(found)


@pytest.fixture(scope="module")
def environment(runtime: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Where Python imports a sanitized build before the one that is installed."""
    try:
        bullet = fetch(install.BUILD)
    except FetchError as missing:
        pytest.skip(str(missing.args[0]))
    target = tmp_path_factory.mktemp("sanitized")
    built = subprocess.run(
        [sys.executable, "-m", "pip", "install", "--no-deps", "--no-build-isolation", f"--target={target}",
         str(ROOT / "train" / "native")],
        env={**os.environ, "CXX": install.compiler(), "KINEMIMIC_BULLET": str(bullet), "KINEMIMIC_ARCH": "",
             "KINEMIMIC_SANITIZE": "address,undefined"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stdout[-4000:] + built.stderr[-4000:]
    (module,) = target.glob("kinemimic_native*.so")
    assert all(mark in module.read_bytes() for mark in (b"__asan_report", b"__ubsan_handle"))
    return {
        **os.environ,
        "LD_PRELOAD": runtime,
        "PYTHONPATH": str(target),
        "PYTHONMALLOC": "malloc",  # every small object is a block of its own, with watched edges
        "ASAN_OPTIONS": "detect_leaks=0",  # an interpreter that ends gives back nothing
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "OMP_NUM_THREADS": "1",
    }


@pytest.mark.slow
def test_the_sanitizers_find_nothing(environment: dict[str, str]) -> None:
    assert TESTS
    options = ["-q", "-m", "not slow", "-k", "not pybullet", "-p", "no:cacheprovider", "-p", "no:xdist"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options, *map(str, TESTS)],
        cwd=ROOT, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    output = done.stdout + done.stderr
    assert done.returncode == 0, output[-6000:]
    assert "passed" in output
    assert "skipped" not in output, output[-2000:]
    assert "AddressSanitizer" not in output
    assert "runtime error" not in output
