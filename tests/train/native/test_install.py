"""A machine that cannot build the fast engine: one line, no failure, no stamp."""

from __future__ import annotations

import os
import shutil
import subprocess
import venv
from pathlib import Path

import install
import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def python(tmp_path: Path) -> Path:
    """An interpreter of its own, without pip: what a failed build takes away is nobody's."""
    venv.create(tmp_path / "venv", with_pip=False, symlinks=True)
    return tmp_path / "venv" / "bin" / "python"


def one_line(python: Path, tmp_path: Path, **environment: str) -> str:
    """What the command says in a copy of the project where it ends well and leaves no stamp."""
    shutil.copytree(ROOT / "train" / "native", tmp_path / "train" / "native")
    stamp = tmp_path / "stamp"
    stamp.touch()  # of an earlier build
    done = subprocess.run(
        [str(python), str(tmp_path / "train" / "native" / "install.py"), "fetched", str(stamp)],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, stamp.exists()) == (0, "", False)
    assert done.stderr.count("\n") == 1
    assert install.COST in done.stderr
    return done.stderr


def test_no_compiler(python: Path, tmp_path: Path) -> None:
    said = one_line(python, tmp_path, CXX="no-such-compiler")
    assert "no C++ compiler found (no-such-compiler)" in said
    assert "install one" in said
    assert not (tmp_path / "build").exists()  # 80 MB are not fetched for nothing


def test_no_sources(python: Path, tmp_path: Path) -> None:
    assert "expected the source archive of pybullet" in one_line(python, tmp_path, CXX="true")


def test_the_compiler_is_the_one_that_is_named_else_one_that_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CXX", raising=False)
    monkeypatch.setattr("sysconfig.get_config_var", lambda name: "gone-g++ -pthread")
    with pytest.raises(install.MissingError, match=r"gone-g\+\+ -pthread, c\+\+, g\+\+, clang\+\+"):
        install.compiler()
    for name in ("clang++", "mine"):
        (tmp_path / name).touch(mode=0o755)
    assert install.compiler() == "clang++"
    monkeypatch.setenv("CXX", "mine -m64")
    assert install.compiler() == "mine -m64"


@pytest.mark.parametrize(
    ("log", "line"),
    [
        (
            "g++ -Werror=format-security -c a.cpp\na.cpp:1:10: fatal error: Python.h: No such file\n"
            "error: command 'g++' failed\nERROR: Failed building wheel for kinemimic-native\n",
            "a.cpp:1:10: fatal error: Python.h: No such file",
        ),
        (
            "  kinemimic-native: pkg-config finds none\n  error: x\n",
            "kinemimic-native: pkg-config finds none",
        ),
        ("ImportError: undefined symbol: _Z3f\n", "ImportError: undefined symbol: _Z3f"),
        ("", "no reason was given"),
    ],
)
def test_the_line_that_says_most(log: str, line: str) -> None:
    assert install.first_error(log) == line
