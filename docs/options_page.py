"""Hook of mkdocs: fill options.md with the help of every command, from the commands themselves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import click

from kinemimic.pipeline.cli.main import cli

MARKER = "<!-- help of every command -->"
# Characters in a line, as on a terminal: the page must not depend on the one that it is built in.
WIDTH = 80


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """The text of a page; mkdocs calls this for each."""
    if page.file.src_uri != "options.md":
        return markdown
    return markdown.replace(MARKER, "\n".join(sections(cli, "kinemimic")))


def sections(command: click.Command, name: str, above: click.Context | None = None) -> Iterator[str]:
    """A section for a command, then those of the commands below it, in the order of `--help`."""
    context = click.Context(
        command, info_name=name, parent=above, terminal_width=WIDTH, **command.context_settings
    )
    # The commands of a group stand one level below it; mkdocs makes the anchor #kinemimic-datasets-list.
    yield f"{'##' if above is None or above.parent is None else '###'} {context.command_path}\n"
    yield f"```text\n{command.get_help(context)}\n```\n"
    if isinstance(command, click.Group):
        for below in command.list_commands(context):
            if (found := command.get_command(context, below)) is not None:
                yield from sections(found, below, context)
