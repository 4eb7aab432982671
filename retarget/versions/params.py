"""Parameters of a versioned data set: one TOML file, which `dvc.yaml` reads too."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Literal

import click
from msgspec import Meta, Struct

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.validation.bounded import MEGABYTE
from kinemimic.pipeline.files.validation.records import RecordError, convert, one_of
from kinemimic.pipeline.files.validation.toml_file import parse_toml, read_text
from kinemimic.pipeline.filters.options import FILTERS
from kinemimic.retarget.feet.ankles import AnkleMode

PARAMS = Path("datasets/versions/params.toml")
MAX_BYTES = MEGABYTE
_NAME, _NAMES = r"\A[a-z0-9_]+\Z", "names of small letters, digits and _"
_RECORDING = "the path of a recording, relative to the build folder"
_Tolerance = Annotated[float, Meta(ge=0.0, le=1e6)]

params_option: Callable[[Callable[..., Any]], Callable[..., Any]] = click.option(
    "--params",
    "path",
    type=click.Path(path_type=Path),
    default=PARAMS,
    show_default=True,
    help="Parameters of the data set.",
)


class Capture(Struct, frozen=True, forbid_unknown_fields=True, rename={"recording": "file"}):
    """A recording of the data set, with options of `ingest` and `retarget` and their defaults.

    recording: path of the raw file relative to the build folder, in a folder that contains only raw files.
    """

    recording: Annotated[str, Meta(description=_RECORDING)]
    filter: Annotated[str, one_of(FILTERS)] | None = None
    symmetric: bool | None = None
    refined: bool = True
    ankle: AnkleMode = "neutral"
    loop: bool | None = None

    def __post_init__(self) -> None:
        path = PurePosixPath(self.recording)
        if not path.name or path.is_absolute() or ".." in path.parts:
            raise RecordError("file", expected=_RECORDING, found=repr(self.recording))

    @property
    def file(self) -> Path:
        """The recording's path."""
        return Path(self.recording)


class _File(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    schema: Literal[1]
    version: Annotated[int, Meta(ge=1, le=1_000_000)]
    captures: dict[str, Capture] = {}
    policies: tuple[Annotated[str, Meta(pattern=_NAME, description=_NAMES)], ...] = ()
    tolerances: dict[str, _Tolerance] = {}

    def __post_init__(self) -> None:
        # They become names of folders.
        for name in self.captures:
            if not re.match(_NAME, name):
                raise RecordError("captures", expected=_NAMES, found=repr(name))


@dataclass(frozen=True)
class Params:
    """path: of this file; version: of the data set, raised by one whenever its content changes; captures: by
    name; policies: the shipped ones that are scored; tolerances: of their scores, by metric."""

    path: Path
    version: int
    captures: Mapping[str, Capture]
    policies: tuple[str, ...]
    tolerances: Mapping[str, float]

    @classmethod
    def load(cls, path: Path, root: Path = Path()) -> Params:
        """path: relative to `root`, the build folder. A KinemimicError names the first mistake's key."""
        text = read_text(root / path, MAX_BYTES, "the parameters of a data set", shown=path)
        file = convert(parse_toml(path, text), _File, path)
        return cls(path, file.version, file.captures, file.policies, file.tolerances)

    def capture(self, name: str) -> Capture:
        """One of the captures; a KinemimicError lists them all."""
        if name not in self.captures:
            raise KinemimicError(
                f"{self.path}: expected a capture among {', '.join(self.captures)}, found {name!r}"
            )
        return self.captures[name]
