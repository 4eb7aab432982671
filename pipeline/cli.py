"""The command line: a lazy group, so that `kinemimic --help` loads nothing but click."""

from __future__ import annotations

import importlib
import sys
from typing import Any

import click

from kinemimic.pipeline.errors import KinemimicError

# Each command's module is named in a string and loaded when it runs: the command line lies in the lowest
# layer and must not import the layers above it.
COMMANDS: dict[str, tuple[str, str]] = {
    "ingest": ("kinemimic.pipeline.ingest:command", "Read a capture: passes, gaps, filter, quality report."),
    "convert": ("kinemimic.pipeline.convert:command", "Euler angles or positions to quaternions."),
    "retarget": ("kinemimic.retarget.stage:command", "Onto the 20 nodes and the body; JSON and MCAP."),
    "train": ("kinemimic.train.stage:command", "Train a policy that imitates the motion in Bullet."),
    "evaluate": ("kinemimic.evaluate.stage:command", "Score the policy; report, curves, scores.json."),
    "view": ("kinemimic.evaluate.view:command", "Reference against simulated, as a rerun recording."),
    "run": ("kinemimic.evaluate.run:command", "Every stage on one capture, skipping what is up to date."),
}


class LazyGroup(click.Group):
    """A group whose commands are imported when they are called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module, attribute = COMMANDS[cmd_name][0].split(":")
        command: click.Command = getattr(importlib.import_module(module), attribute)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])


@click.group(cls=LazyGroup)
@click.version_option(package_name="kinemimic")
def cli() -> None:
    """Recorded human motion in, a Bullet humanoid that performs it out, with a score."""


def main(arguments: list[str] | None = None) -> Any:
    """Entry point: an error of the input is one line on stderr and exit status 2."""
    try:
        return cli.main(arguments, standalone_mode=True)
    except KinemimicError as error:
        click.echo(f"kinemimic: {error}", err=True)
        sys.exit(2)
