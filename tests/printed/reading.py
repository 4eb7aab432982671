"""A page's reader: follows the page in a folder of its own, block by block."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from printed.blocks import ROOT, Block, commands
from printed.declared import cheaper, cheaper_python, reason

Environment = dict[str, str]


def environment(programs: Path | None = None, kept: Mapping[str, str] = os.environ) -> Environment:
    """Environment variables: `kinemimic` of a folder, by default this one's; one thread per process."""
    path = f"{programs or Path(sys.executable).parent}{os.pathsep}{kept['PATH']}"
    return {**kept, "PATH": path, "OMP_NUM_THREADS": "1"}


def shell(text: str, folder: Path, env: Environment) -> subprocess.CompletedProcess[str]:
    """Run a command as in a user's shell."""
    return subprocess.run(
        ["bash", "-o", "pipefail", "-c", text],
        cwd=folder,
        env=env,
        capture_output=True,
        text=True,
        check=False,
    )


def in_sequence(pieces: Sequence[str], text: str) -> bool:
    """Whether the pieces occur in a text in this order."""
    start = 0
    for piece in pieces:
        found = text.find(piece, start)
        if found < 0:
            return False
        start = found + len(piece)
    return True


class Reader:
    """Follows a page, block by block, in a folder of its own."""

    def __init__(self, folder: Path, env: Environment) -> None:
        # datasets keeps its copies in the page's folder.
        self.folder, self.env = folder, {**env, "HF_HOME": str(folder / ".huggingface")}
        self.printed = ""  # by the last `sh` block

    def follow(self, block: Block) -> None:
        """Run a block's commands, write its file, apply its change or compare its output."""
        if block.language == "sh":
            self.printed = ""
            for command in commands(block):
                if reason(command.text) is None:
                    done = shell(cheaper(command.text), self.folder, self.env)
                    assert done.returncode == 0, (
                        f"{command.place}: {command.text}\n{done.stdout}\n{done.stderr}"
                    )
                    self.printed += done.stdout
        elif block.language == "python":
            if block.title:
                self._write(block)
            else:
                script = self.folder / "script.py"
                script.write_text(cheaper_python(block.text))
                done = shell("python script.py", self.folder, self.env)
                assert done.returncode == 0, f"{block.place}\n{done.stdout}\n{done.stderr}"
        elif block.language == "diff":
            self._apply(block)
        elif block.language == "console":
            self._compare(block)
        elif block.language == "text":
            # Lines wrap at the width of the terminal.
            expected, found = (" ".join(text.split()) for text in (block.text, self.printed))
            assert in_sequence(expected.split("…"), found), f"{block.place}: {self.printed}"

    def said(self, command: str) -> str:
        """The output of a command that must succeed."""
        done = shell(command, self.folder, self.env)
        assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    def _write(self, block: Block) -> None:
        """Write the block to the source file named by its title."""
        path = self._sources() / block.title
        assert not path.exists(), f"{block.place}: {block.title} is there already"
        path.write_text(block.text)

    def _apply(self, block: Block) -> None:
        change = self.folder / "change.diff"
        change.write_text(block.text)
        done = shell(f"git apply --whitespace=nowarn {change}", self._sources(), self.env)
        assert done.returncode == 0, f"{block.place}\n{done.stderr}"

    def _sources(self) -> Path:
        """A copy of the sources, first in the path, made when a page first changes something."""
        place = self.folder / ".sources"
        if not place.exists():
            for name in ("pipeline", "retarget", "train", "evaluate", "datasets"):
                ignored = shutil.ignore_patterns("__pycache__", "native")
                shutil.copytree(ROOT / name, place / "kinemimic" / name, ignore=ignored)
            # A folder without __init__.py loses to the installed package, even first in the path.
            for file in (ROOT / "api").glob("*.py"):
                shutil.copy(file, place / "kinemimic")
            before = self.env.get("PYTHONPATH")
            self.env["PYTHONPATH"] = f"{place}{os.pathsep}{before}" if before else str(place)
        return place / "kinemimic"

    def _compare(self, block: Block) -> None:
        """Each `$ command` prints the lines below it; `…` matches anything."""
        for part in block.text.removeprefix("$ ").split("\n$ "):
            command, _, expected = part.partition("\n")
            done = shell(command, self.folder, self.env)
            assert done.returncode == 2, f"{block.place}: {command}: status {done.returncode}"
            pieces = expected.strip().split("…")
            found = (done.stdout + done.stderr).strip()
            assert found.startswith(pieces[0]) and found.endswith(pieces[-1]), f"{block.place}: {found}"
            assert in_sequence(pieces, found), f"{block.place}: {found}"
