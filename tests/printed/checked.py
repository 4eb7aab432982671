"""Whether a command that is not run exists: its program, its sub-command, its options, its make target."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence

import click
from printed.blocks import ROOT

from kinemimic.pipeline.cli import COMMANDS, cli, load_command

# Programs that come with what is installed, or with the system.
PROGRAMS = frozenset({"cp", "mkdir", "rerun", "tensorboard"})
_ASSIGNED = re.compile(r"[A-Z_]+=")


def check(words: Sequence[str]) -> None:
    """AssertionError or click's own error if there is no such command, option or make target."""
    program, *arguments = [word for word in words if not _ASSIGNED.match(word)]
    if program == "kinemimic":
        check_kinemimic(arguments)
    elif program == "make":
        check_make(arguments, [word.split("=")[0] for word in words if _ASSIGNED.match(word)])
    elif program == "pip":
        check_extras(arguments)
    else:
        assert program in PROGRAMS, f"{program}: no program that a page may call"


def check_kinemimic(arguments: Sequence[str], *, whole: bool = True) -> None:
    """Parse by click, without running.

    whole: with all that the command asks for; else its name and the names of its options alone.
    """
    name, *rest = arguments
    if name.startswith("-"):
        cli.make_parser(click.Context(cli)).parse_args([name])
        return
    assert name in COMMANDS, f"no command {name!r}"
    command = load_command(name)
    if whole:
        command.make_context(name, list(rest))
    else:
        command.make_parser(click.Context(command)).parse_args(list(rest))


def check_make(targets: Sequence[str], variables: Sequence[str]) -> None:
    """Every target is one of `make help`, and every variable is one that the Makefile reads."""
    text = (ROOT / "Makefile").read_text()
    known = set(re.findall(r"^([a-z-]+):.*## ", text, re.MULTILINE))
    for target in targets:
        assert target in known, f"make {target}: no such target"
    for variable in variables:
        assert f"$({variable})" in text or variable.startswith("PIP_"), f"{variable}: the Makefile does not read it"


def check_extras(arguments: Sequence[str]) -> None:
    """Extras of kinemimic that are asked for are in pyproject.toml."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for argument in arguments:
        if found := re.fullmatch(r"(?:kinemimic|\.)\[(\w+)\]", argument):
            assert found[1] in extras, f"{argument}: no such extra"
