"""The command line: a lazy group, so that `kinemimic --help` loads nothing but click."""

from __future__ import annotations

import io
import logging
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import click

from kinemimic.pipeline.cli.heartbeat import heartbeat, running_for
from kinemimic.pipeline.cli.lazy_group import LazyGroup, load
from kinemimic.pipeline.cli.printable import echo, replace_what_cannot_be_encoded
from kinemimic.pipeline.cli.settings import read_settings, require_commands
from kinemimic.pipeline.errors import KinemimicError, one_line
from kinemimic.pipeline.parallel.interruption import ended_by_sigterm

# Each command is named by a string and imported when it runs: the command line belongs to the lowest layer,
# which must not import the layers above it.
COMMANDS: dict[str, tuple[str, str]] = {
    "run": (
        "kinemimic.evaluate.workflow.run:command",
        "Run all stages on one capture; skip those up to date.",
    ),
    "ingest": ("kinemimic.pipeline.ingest:command", "Read a capture: passes, gaps, filter, quality report."),
    "convert": (
        "kinemimic.pipeline.convert:command",
        "Convert Euler angles or positions to quaternions.",
    ),
    "retarget": (
        "kinemimic.retarget.command:command",
        "Retarget to the 20 nodes and the humanoid; JSON and MCAP.",
    ),
    "train": ("kinemimic.train.command:command", "Train a policy that imitates the motion in Bullet."),
    "evaluate": (
        "kinemimic.evaluate.command:command",
        "Score a policy: report, curves, scores.json.",
    ),
    "view": ("kinemimic.evaluate.view.command:command", "Show capture, reference and simulation in rerun."),
    "gait": (
        "kinemimic.evaluate.scoring.gait_command:command",
        "Compare the gait of capture, reference and simulation with norms.",
    ),
    "export": (
        "kinemimic.evaluate.export.command:command",
        "Export motions and policies: BVH, TRC, MOT, CSV, npz, ONNX …",
    ),
    "pushes": (
        "kinemimic.evaluate.robustness.pushes:command",
        "Measure the hardest push that the policy survives, by side.",
    ),
    "disturb": (
        "kinemimic.evaluate.robustness.disturb:command",
        "Run scenarios: forces, torques, obstacles, different ground.",
    ),
    "simulate": (
        "kinemimic.evaluate.simulate.command:command",
        "Push a humanoid on a page in the browser, in real time.",
    ),
    "stream": (
        "kinemimic.evaluate.stream.command:command",
        "Let a live capture drive the humanoid: UDP, TCP, VMC, a file.",
    ),
    "batch": (
        "kinemimic.evaluate.batch.command:command",
        "Make a data set of the motions of many captures.",
    ),
    "library": (
        "kinemimic.evaluate.library.command:command",
        "Make one motion library of many captures, split by subject.",
    ),
    "train-tracker": (
        "kinemimic.train.tracker.command:command",
        "Train one policy for any motion, on a motion library.",
    ),
    "correct-tracker": (
        "kinemimic.train.tracker.correct_command:command",
        "Let a tracker unlearn its systematic errors at knees and hips.",
    ),
    "train-predictor": (
        "kinemimic.train.prediction.command:command",
        "Learn from a motion library how a motion goes on.",
    ),
    "evaluate-tracker": (
        "kinemimic.evaluate.scoring.tracker_command:command",
        "Score a tracker on every motion of a library.",
    ),
    "policies": (
        "kinemimic.evaluate.policies.command:command",
        "List the shipped policies and their scores.",
    ),
    "reproduce": ("kinemimic.evaluate.workflow.reproduce:command", "Retrain the shipped policies."),
    "compare": (
        "kinemimic.evaluate.compare.command:command",
        "Train and score several tasks, presets and seeds.",
    ),
    "study": (
        "kinemimic.evaluate.paper.command:command",
        "Repeat the paper's experiments and compare the numbers.",
    ),
    "formats": ("kinemimic.pipeline.inspect.formats:command", "List the readable capture formats."),
    "inspect": (
        "kinemimic.pipeline.inspect.command:command",
        "Report contents and quality of capture files.",
    ),
    "overlay": (
        "kinemimic.pipeline.overlay.command:command",
        "Draw the skeleton into a video or a depth recording.",
    ),
    "gallery": (
        "kinemimic.evaluate.view.gallery:command",
        "Draw the rollouts of several runs side by side.",
    ),
    "datasets": (
        "kinemimic.pipeline.catalog.command:command",
        "Public recordings, and versioned data sets made from recordings.",
    ),
}

BAD_INPUT = 2
INTERRUPTED = 130  # 128 + SIGINT, as a shell reports for a program that was ended by Ctrl-C


def load_command(name: str) -> click.Command:
    """Import a command's module and return the command."""
    return load(COMMANDS[name][0])


@click.group(cls=LazyGroup, lazy=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="kinemimic")
def cli() -> None:
    """Turn recorded human motion into a simulated humanoid that performs it, with a score."""


def main(arguments: list[str] | None = None) -> NoReturn:
    """Entry point: errors that the user can fix are one line on stderr; only a bug shows a traceback."""
    replace_what_cannot_be_encoded()
    sys.exit(_status(arguments))


def _status(arguments: list[str] | None) -> int:
    logging.basicConfig(format="kinemimic: %(message)s", level=logging.WARNING)
    try:
        settings = read_settings()
        require_commands(settings, COMMANDS)
        with ended_by_sigterm(), heartbeat(_line(sys.argv[1:] if arguments is None else arguments)):
            status: Any = cli.main(
                arguments,
                prog_name="kinemimic",
                standalone_mode=False,
                default_map=settings,
            )
    except KinemimicError as error:
        return _fail(str(error))
    except click.ClickException as error:
        shown = io.StringIO()
        error.show(file=shown)
        echo(shown.getvalue(), err=True, nl=False)
        return error.exit_code
    except click.Abort as abort:
        # click turns an EOFError into an Abort too; here it comes from a lost pipe and is a bug.
        if isinstance(abort.__cause__, EOFError):
            raise abort.__cause__ from None
        message = str(abort.__cause__ or "")
        echo("kinemimic: interrupted" + (f"; {message}" if message else ""), err=True)
        return INTERRUPTED
    except ConnectionError:
        # The reader of our output has gone (`kinemimic … | head`); any other lost connection is a bug.
        if _stdout_works():
            raise
        return 1
    except OSError as error:
        return _fail(_described(error))
    return status if isinstance(status, int) else 0


def _line(arguments: list[str]) -> Callable[[], str]:
    """The heartbeat of a command: nothing with --json."""
    return str if "--json" in arguments else running_for(next(iter(arguments), "kinemimic"))


def _fail(message: str) -> int:
    echo("kinemimic: " + " ".join(message.split()), err=True)
    return BAD_INPUT


def _described(error: OSError) -> str:
    if isinstance(error, FileNotFoundError) and error.filename is None and not _has_working_folder():
        return "the current folder no longer exists; change to another one"
    name = str(error.filename or "")
    return one_line(error).replace(name, _shortened(name), 1)


def _has_working_folder() -> bool:
    try:
        Path.cwd()
    except FileNotFoundError:
        return False
    return True


def _shortened(path: str, most: int = 300) -> str:
    """A path of at most `most` characters, or its beginning and length: one of 5,000 hides the message."""
    return path if len(path) <= most else f"{path[:80]}… ({len(path):,} characters)"


def _stdout_works() -> bool:
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        # Python flushes once more at exit, which must not fail either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return False
    return True
