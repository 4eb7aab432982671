"""The command line: a lazy group, so that `kinemimic --help` loads nothing but click."""

from __future__ import annotations

import os
import sys
from typing import Any, NoReturn

import click

from kinemimic.pipeline.cli.lazy_group import LazyGroup, load
from kinemimic.pipeline.errors import KinemimicError

# Each command's module is named in a string and loaded when it runs: the command line lies in the lowest
# layer and must not import the layers above it.
COMMANDS: dict[str, tuple[str, str]] = {
    "formats": ("kinemimic.pipeline.inspect.formats:command", "The capture formats that can be read."),
    "datasets": (
        "kinemimic.pipeline.catalog.command:command",
        "Public recordings, and versions of data made of recordings.",
    ),
    "inspect": ("kinemimic.pipeline.inspect.command:command", "What captures are, and how good they are."),
    "ingest": ("kinemimic.pipeline.ingest:command", "Read a capture: passes, gaps, filter, quality report."),
    "convert": ("kinemimic.pipeline.convert:command", "Euler angles or positions to quaternions."),
    "retarget": ("kinemimic.retarget.command:command", "Onto the 20 nodes and the body; JSON and MCAP."),
    "train": ("kinemimic.train.command:command", "Train a policy that imitates the motion in Bullet."),
    "evaluate": (
        "kinemimic.evaluate.scoring.command:command",
        "Score the policy; report, curves, scores.json.",
    ),
    "pushes": (
        "kinemimic.evaluate.robustness.pushes:command",
        "How hard a push the policy survives, from each side.",
    ),
    "disturb": (
        "kinemimic.evaluate.robustness.disturb:command",
        "Forces, torques, obstacles, other ground: scenarios.",
    ),
    "gait": (
        "kinemimic.evaluate.scoring.gait_command:command",
        "Gait of capture, reference and simulation, over what is normal.",
    ),
    "overlay": (
        "kinemimic.pipeline.overlay.command:command",
        "A video of a depth recording and its skeleton.",
    ),
    "view": ("kinemimic.evaluate.view.command:command", "Reference against simulated, as a rerun recording."),
    "export": (
        "kinemimic.evaluate.export.command:command",
        "Capture, reference, simulated motion, policy: BVH, TRC, MOT, CSV, npz, ONNX …",
    ),
    "policies": (
        "kinemimic.evaluate.policies.command:command",
        "The policies that ship, and how well they do.",
    ),
    "reproduce": ("kinemimic.evaluate.workflow.reproduce:command", "Make the policies that ship."),
    "compare": (
        "kinemimic.evaluate.compare.command:command",
        "Tasks, presets and seeds trained and scored side by side: a table.",
    ),
    "study": (
        "kinemimic.evaluate.paper.command:command",
        "The paper's experiments: its every number, ours beside.",
    ),
    "run": (
        "kinemimic.evaluate.workflow.run:command",
        "Every stage on one capture, skipping what is up to date.",
    ),
}

BAD_INPUT = 2
INTERRUPTED = 130  # 128 + SIGINT, what a shell reports for a program that Ctrl-C ended


def load_command(name: str) -> click.Command:
    """Import a command's module and return the command."""
    return load(COMMANDS[name][0])


@click.group(cls=LazyGroup, lazy=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="kinemimic")
def cli() -> None:
    """Recorded human motion in, a Bullet humanoid that performs it out, with a score."""


def main(arguments: list[str] | None = None) -> NoReturn:
    """Entry point: whatever the user can mend is one line on stderr; only a bug shows its traceback."""
    sys.exit(_status(arguments))


def _status(arguments: list[str] | None) -> int:
    try:
        status: Any = cli.main(arguments, prog_name="kinemimic", standalone_mode=False)
    except KinemimicError as error:
        return _fail(str(error))
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except click.Abort as abort:
        # click makes an Abort of an EOFError too, which here is a worker process that died: a bug.
        if isinstance(abort.__cause__, EOFError):
            raise abort.__cause__ from None
        said = str(abort.__cause__ or "")
        click.echo("kinemimic: interrupted" + (f"; {said}" if said else ""), err=True)
        return INTERRUPTED
    except ConnectionError:
        # The reader of our output went away (`kinemimic … | head`), or else a worker process died: a bug.
        if _stdout_works():
            raise
        return 1
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        return _fail(f"{place}{(error.strerror or str(error)).lower()}")
    return status if isinstance(status, int) else 0


def _fail(message: str) -> int:
    click.echo("kinemimic: " + " ".join(message.split()), err=True)
    return BAD_INPUT


def _stdout_works() -> bool:
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        # Python flushes once more at exit; that shall not complain either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return False
    return True
