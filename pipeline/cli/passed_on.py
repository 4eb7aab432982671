"""Options of stages that a command of several stages takes and passes on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import click

from kinemimic.pipeline.cli.options import Decorator, declared


def passed_on(groups: Mapping[str, Decorator]) -> list[click.Option]:
    """The options of the stages in `groups`; unset, each leaves its stage the default."""
    options: dict[str, click.Option] = {}
    stages: dict[str, list[str]] = {}
    for name, group in groups.items():
        for option in declared(group):
            options[option.opts[0]] = option
            stages.setdefault(option.opts[0], []).append(name)
    for name, option in options.items():
        default = name.removeprefix("--") if option.default is True else option.default
        shown = f"; default: {default}" if option.show_default else ""
        option.help = f"{option.help} [{', '.join(stages[name])}{shown}]"
        option.default, option.show_default = None, False
    return list(options.values())


def stage_options(groups: Mapping[str, Decorator], values: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Stage -> the options that were set, as `run` takes them."""
    options: dict[str, dict[str, Any]] = {}
    for name, group in groups.items():
        options[name] = {}
        for option in declared(group):
            value, names = values[option.name or ""], option.opts
            if option.is_flag:
                # --loop/--no-loop: False is the second name.
                names, value = (option.secondary_opts, True) if value is False else (names, value)
            if value is not None and names:
                options[name][names[0].removeprefix("--")] = value
    return options
