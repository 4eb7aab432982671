"""A group of commands that are imported when they run, so that `--help` loads only click."""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Mapping
from typing import Any

import click

from kinemimic.pipeline.cli.settings import bind_variables, defaults_of, require_commands

# Name -> ("module:attribute" of the command, its help in one line).
Commands = Mapping[str, tuple[str, str]]


def load(where: str) -> click.Command:
    """Import a command's module ("module:attribute") and return the command."""
    module, attribute = where.split(":")
    command: click.Command = getattr(importlib.import_module(module), attribute)
    return command


class LazyGroup(click.Group):
    """A group of commands by name: `@click.group(cls=LazyGroup, lazy=COMMANDS)`."""

    def __init__(self, *arguments: Any, lazy: Commands, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.lazy = lazy

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.lazy)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        return load(self.lazy[cmd_name][0]) if cmd_name in self.lazy else None

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0]
        if name not in self.lazy and not name.startswith("-"):
            near = difflib.get_close_matches(name, self.lazy, n=1)
            ctx.fail(f"no command {name!r}" + (f"; did you mean {near[0]!r}?" if near else ""))
        found, command, rest = super().resolve_command(ctx, args)
        if found is not None and command is not None:
            if ctx.default_map:
                ctx.default_map = {found: self._settings(ctx, found, command)}
            if not isinstance(command, click.Group):
                bind_variables(command, f"{ctx.command_path.partition(' ')[2]} {found}".strip())
        return found, command, rest

    def _settings(self, ctx: click.Context, name: str, command: click.Command) -> dict[str, Any]:
        """What the settings file says of a command, as its default_map."""
        within = ctx.command_path.partition(" ")[2]
        section = dict((ctx.default_map or {}).get(name, {}))
        if isinstance(command, LazyGroup):
            require_commands(section, command.lazy, f"{name}.")
            return section
        return defaults_of(command, f"{within}.{name}" if within else name, section)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in self.lazy.items()])
