"""Options that several commands share, and groups of options."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from kinemimic.pipeline.cli.finite_range import FiniteRange
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.run_folder.capture import only_run

Command = TypeVar("Command", bound=Callable[..., Any])
Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]

# As in quality/rules/length_units.py, which is too slow to import for --help.
UNITS = ("m", "ft", "dm", "cmu", "inch", "cm", "mm")
# In Hz, as in readers/clocks/frame_rate.py, for the same reason.
RATES = (1.0, 1000.0)
# Metres and degrees, as in readers/video/options.py, for the same reason.
HEIGHTS, FIELDS_OF_VIEW = (0.5, 2.6), (10.0, 150.0)

LARGEST_SEED = 2**63 - 1  # of torch; numpy takes any


class RunFolder(click.Path):
    """The path of a folder that need not exist; a file in its place, or no name, is refused at once."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """A Path; KinemimicError for a file, and for an empty name."""
        if not os.fspath(value):
            # Path("") is the current folder.
            raise KinemimicError("--run: expected the name of a run folder, found an empty one")
        run = Path(os.fsdecode(super().convert(value, param, ctx)))
        if run.is_file():
            raise KinemimicError(f"{run}: expected a run folder, found a file; choose another --run")
        return run


def option_group(*options: Decorator) -> Decorator:
    """One decorator for several options, in the order of --help."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


def declared(options: Decorator) -> list[click.Option]:
    """The options that a decorator adds to a command."""

    def command() -> None: ...

    options(command)
    return [*reversed(command.__click_params__)]  # type: ignore[attr-defined]


def run_option(
    name: str = "run", *, default: Callable[[], Path] | None = only_run
) -> Callable[[Command], Command]:
    """--run, a path, passed to the command as `name`; default: of a command that needs an existing folder.

    With None as the default, the command names the folder after the capture.
    """
    shown = "the only one in runs/" if default else "runs/NAME, after the capture"
    return click.option(
        "--run", name, type=RunFolder(), default=default, help=f"Run folder. Default: {shown}."
    )


overwrite_option = click.option(
    "--overwrite", is_flag=True, help="If the run folder has the results of another capture, set them aside."
)


def unit_option(text: str) -> Callable[[Command], Command]:
    """--unit, a length unit by its short name or None."""
    return click.option("--unit", type=click.Choice(UNITS), help=text)


def rate_option(text: str) -> Callable[[Command], Command]:
    """--rate, a frame rate in Hz or None."""
    return click.option("--rate", type=FiniteRange(*RATES), metavar="HZ", help=text)


# Of a video: --height, --fov, --person, --pose-model.
video_options: tuple[Decorator, ...] = (
    click.option(
        "--height",
        type=FiniteRange(*HEIGHTS),
        metavar="METRES",
        help="Video: height of the person. Default: 1.70.",
    ),
    click.option(
        "--fov",
        type=FiniteRange(*FIELDS_OF_VIEW),
        metavar="DEGREES",
        help="Video: field of view along the longer side. Default: about 67, a phone's.",
    ),
    click.option(
        "--person",
        type=click.IntRange(min=1),
        metavar="N",
        help="Video: which person, counted from the left. Default: the largest.",
    ),
    click.option(
        "--pose-model",
        type=click.Path(path_type=Path, exists=True, dir_okay=False),
        help="Video: a BlazePose landmark model (.tflite). Default: the full one, fetched once.",
    ),
)


def seed_option(text: str = "Random seed.") -> Callable[[Command], Command]:
    """--seed, an integer that every random generator takes."""
    return click.option(
        "--seed", type=click.IntRange(0, LARGEST_SEED), default=0, show_default=True, help=text
    )


def json_option(text: str) -> Callable[[Command], Command]:
    """--json, a flag, passed to the command as `as_json`."""
    return click.option("--json", "as_json", is_flag=True, help=text)


def jobs_option(text: str) -> Callable[[Command], Command]:
    """--jobs, a number of processes or None for one per core."""
    return click.option("-j", "--jobs", type=click.IntRange(min=1), help=f"{text} Default: one per core.")


def out_option(text: str, default: Path | None = None) -> Callable[[Command], Command]:
    """--out, the folder of the results; required without a default."""
    # click takes a default of None for a value.
    how = {"required": True} if default is None else {"default": default, "show_default": True}
    return click.option("--out", type=click.Path(path_type=Path, file_okay=False), help=text, **how)


# LOCAL of parallel/cluster.py, in place of an address.
ray_option: Decorator = click.option(
    "--ray",
    metavar="[ADDRESS]",
    is_flag=False,
    flag_value="local",
    help="Run on the Ray cluster whose head node is at ADDRESS (HOST:PORT); without ADDRESS, start Ray on "
    "this machine. Needs the extra `scale`.",
)
