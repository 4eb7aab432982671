"""The fenced blocks and the commands of README.md and docs/*.md."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES: tuple[Path, ...] = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))

_FENCE = re.compile(r'```(\w*)(?: title="([^"]*)")?')
_INLINE = re.compile(r"`(kinemimic [a-z][^`]*)`")
_OPERATORS = frozenset("();<>|&")


@dataclass(frozen=True)
class Block:
    """A fenced block; line: number of its fence, from 1; title: "" if absent."""

    page: Path
    line: int
    language: str
    title: str
    text: str

    @property
    def place(self) -> str:
        return f"{self.page.name}:{self.line}"


@dataclass(frozen=True)
class Command:
    """A command of an `sh` block: continued lines joined, without its comment."""

    page: Path
    line: int
    text: str

    @property
    def place(self) -> str:
        return f"{self.page.name}:{self.line}"

    @property
    def parts(self) -> list[list[str]]:
        """The words of each simple command between pipes, redirections and the like."""
        lexer = shlex.shlex(self.text, posix=True, punctuation_chars=True)
        lexer.whitespace_split = True
        found: list[list[str]] = [[]]
        into_file = False
        for word in lexer:
            if set(word) <= _OPERATORS:
                into_file = ">" in word or "<" in word
                if not into_file:
                    found.append([])
            elif into_file:
                into_file = False
            else:
                found[-1].append(word)
        return [words for words in found if words]


def blocks(page: Path) -> Iterator[Block]:
    """Every fenced block of a page, in order."""
    opened: tuple[int, str, str] | None = None
    held: list[str] = []
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), start=1):
        fence = _FENCE.fullmatch(line)
        if opened is None:
            if fence:
                opened, held = (number, fence[1], fence[2] or ""), []
        elif line == "```":
            yield Block(page, *opened, "\n".join(held) + "\n")
            opened = None
        else:
            held.append(line)
    assert opened is None, f"{page.name}:{opened}: unclosed fence"


def commands(block: Block) -> Iterator[Command]:
    """The commands of an `sh` block."""
    held, begun = "", 0
    for number, line in enumerate(block.text.splitlines(), start=block.line + 1):
        begun = begun if held else number
        held += _without_comment(line)
        if held.endswith("\\"):
            held = held[:-1].rstrip() + " "
        elif held.strip():
            yield Command(block.page, begun, held.strip())
            held = ""
        else:
            held = ""


def _without_comment(line: str) -> str:
    found = re.search(r"(^|\s)#", line)
    return (line[: found.start()] if found else line).rstrip()


def printed() -> list[Command]:
    """Every command of every page."""
    return [
        command
        for page in PAGES
        for block in blocks(page)
        if block.language == "sh"
        for command in commands(block)
    ]


def inline() -> Iterator[Command]:
    """Commands in running text: `kinemimic …`; a command that a sentence only names is one word."""
    for page in PAGES:
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), start=1):
            for text in _INLINE.findall(line):
                yield Command(page, number, text)
