"""Settings of commands in a file: kinemimic.toml in the current folder, a table per command.

    [train]
    budget = "2M"

Options on the command line come first, then environment variables (KINEMIMIC_TRAIN_BUDGET), then this file.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import click

from kinemimic.pipeline.errors import KinemimicError

FILE = Path("kinemimic.toml")
PREFIX = "KINEMIMIC"
_LIMIT = 1_000_000  # bytes


def read_settings(path: Path = FILE) -> dict[str, Any]:
    """Command -> its settings; empty without a file. KinemimicError if it is not TOML."""
    if not path.exists():
        return {}
    # Import cost: few folders have the file.
    from kinemimic.pipeline.files.validation.toml_file import parse_toml, read_text  # noqa: PLC0415

    return parse_toml(path, read_text(path, _LIMIT, "settings"))


def require_commands(settings: Mapping[str, Any], commands: Iterable[str], within: str = "") -> None:
    """KinemimicError for a table that no command has."""
    for name, section in settings.items():
        key = f"{within}{name}"
        if not isinstance(section, dict):
            raise KinemimicError(
                f"{FILE}, key {_shown(key)}: expected a table for a command, as in [train], found a value"
            )
        if name not in commands:
            raise KinemimicError(
                f"{FILE}, table [{_shown(key)}]: expected the name of a command, found none"
                + _near(name, commands)
            )


def defaults_of(command: click.Command, name: str, section: Mapping[str, Any]) -> dict[str, Any]:
    """Settings by option ("budget") as click's default_map, by parameter; KinemimicError for unknown ones."""
    options = _options(command)
    for key, value in section.items():
        if key not in options:
            raise KinemimicError(
                f"{FILE}, table [{name}]: expected an option of `{name}`, found {_shown(key)!r}"
                + _near(key, options)
            )
        if isinstance(value, dict):
            raise KinemimicError(f"{FILE}, table [{name}], key {key}: expected a value, found a table")
    return {options[key].name or "": _value(options[key], value) for key, value in section.items()}


def bind_variables(command: click.Command, name: str) -> None:
    """Let each option be set by its variable: `--preset` of `train` by KINEMIMIC_TRAIN_PRESET.

    click's own names are those of the function's parameters, which a user does not see. KinemimicError for a
    variable of the command that no option has.
    """
    prefix = _variable(f"{PREFIX} {name} ")
    variables = {prefix + _variable(flag): option for flag, option in _options(command).items()}
    for found in os.environ:
        if found.startswith(prefix) and found not in variables:
            near = _near(found, variables)
            raise KinemimicError(f"expected a variable of an option of `{name}`, found {_shown(found)}{near}")
    for variable, option in variables.items():
        option.envvar = variable


def _variable(words: str) -> str:
    return words.upper().replace("-", "_").replace(" ", "_")


def _options(command: click.Command) -> dict[str, click.Option]:
    """A command's options by their names without dashes."""
    return {
        flag.removeprefix("--"): parameter
        for parameter in command.params
        if isinstance(parameter, click.Option)
        for flag in parameter.opts
        if flag.startswith("--")
    }


def _value(option: click.Option, value: Any) -> Any:
    """A value of TOML as click takes it: text, except for flags and lists."""
    if option.multiple:
        return [str(one) for one in value] if isinstance(value, list) else [str(value)]
    return value if isinstance(value, bool) else str(value)


def _near(word: str, choices: Iterable[str]) -> str:
    import difflib  # noqa: PLC0415 (import cost)

    near = difflib.get_close_matches(word, list(choices), n=1)
    return f"; did you mean {near[0]!r}?" if near else ""


def _shown(key: str) -> str:
    return key if len(key) <= 60 else f"{key[:59]}…"
