"""Check that a command exists without running it: its program, sub-command, options, make target."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence

import click

from kinemimic.pipeline.cli.main import COMMANDS, load_command
from printed.blocks import ROOT

# Programs installed with kinemimic, or part of the system.
PROGRAMS = frozenset({"cp", "ray", "rerun", "sed", "tensorboard"})
_ASSIGNED = re.compile(r"[A-Z_]+=")


def check(words: Sequence[str]) -> None:
    """AssertionError or click's error if there is no such command, option or make target."""
    program, *arguments = [word for word in words if not _ASSIGNED.match(word)]
    if program == "kinemimic":
        check_kinemimic(arguments)
    elif program == "make":
        check_make(arguments, [word.split("=")[0] for word in words if _ASSIGNED.match(word)])
    elif program == "pip":
        check_extras(arguments)
    else:
        assert program in PROGRAMS, f"{program}: not a program that a page may call"


def check_kinemimic(arguments: Sequence[str]) -> None:
    """Parse with click, without running."""
    command, rest = found(arguments)
    command.make_context(command.name, list(rest))


def found(arguments: Sequence[str]) -> tuple[click.Command, Sequence[str]]:
    """The command, or the command of a group, and the arguments after its name."""
    name, *rest = arguments
    assert name in COMMANDS, f"no command {name!r}"
    command = load_command(name)
    if not isinstance(command, click.Group):
        return command, rest
    below = command.get_command(click.Context(command), rest[0])
    assert below is not None, f"no command {name} {rest[0]!r}"
    return below, rest[1:]


def check_names(text: str) -> None:
    """Check the command and the option names of an incomplete command line."""
    command, rest = found(text.split()[1:])
    known = {
        option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)
    }
    for option in re.findall(r"(?<![\w-])--[a-z-]+", " ".join(rest)):
        assert option in known | {"--help"}, f"{command.name} has no {option}"


def check_make(targets: Sequence[str], variables: Sequence[str]) -> None:
    """Check that `make help` lists every target, and that the Makefile reads every variable."""
    text = (ROOT / "Makefile").read_text()
    known = set(re.findall(r"^([a-z-]+):.*## ", text, re.MULTILINE))
    for target in targets:
        assert target in known, f"make {target}: no such target"
    for variable in variables:
        assert f"$({variable})" in text or variable.startswith("PIP_"), (
            f"{variable}: the Makefile does not read it"
        )


def check_extras(arguments: Sequence[str]) -> None:
    """Check that pyproject.toml has the requested extras of kinemimic."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for argument in arguments:
        if found := re.fullmatch(r"(?:kinemimic|\.)\[(\w+)\]", argument):
            assert found[1] in extras, f"{argument}: no such extra"
