"""What a versioned data set is made of: one TOML file, which `dvc.yaml` reads too."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import click

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.bounded import MEGABYTE, read_bounded
from kinemimic.pipeline.files.toml_keys import Keys, parse_toml
from kinemimic.pipeline.filters.clean import FILTERS
from kinemimic.retarget.feet.ankles import ANKLE_MODES, AnkleMode

PARAMS = Path("datasets/versions/params.toml")
SCHEMA = 1
MAX_BYTES = MEGABYTE
_NAME = re.compile(r"[a-z0-9_]+")

params_option: Callable[[Callable[..., Any]], Callable[..., Any]] = click.option(
    "--params",
    "path",
    type=click.Path(path_type=Path),
    default=PARAMS,
    show_default=True,
    help="Parameters of the data set.",
)


@dataclass(frozen=True)
class Capture:
    """file: of the raw recording, from the folder that the data set is built in, in a folder with nothing but
    raw files; the rest are options of `ingest` and `retarget`, with their defaults."""

    name: str
    file: Path
    filter: str | None = None
    symmetric: bool | None = None
    refined: bool = True
    ankle: AnkleMode = "neutral"
    loop: bool | None = None


@dataclass(frozen=True)
class Params:
    """path: of this file; version: of the data set, raised by one whenever its content changes; captures: by
    name; policies: that ship and are scored; tolerances: of their scores, by figure."""

    path: Path
    version: int
    captures: Mapping[str, Capture]
    policies: tuple[str, ...]
    tolerances: Mapping[str, float]

    @classmethod
    def load(cls, path: Path, root: Path = Path()) -> Params:
        """path: from `root`, the folder that is built in. A KinemimicError names the first mistake's key."""
        try:
            text = read_bounded(root / path, MAX_BYTES, "the parameters of a data set").decode("utf-8")
        except FileNotFoundError:
            raise KinemimicError(f"{path}: expected the parameters of a data set, found no file") from None
        except UnicodeDecodeError as error:
            raise KinemimicError(f"{path}: expected TOML, found {error}") from None
        keys = Keys(path, "", parse_toml(path, text))
        if (schema := keys.get("schema")) != SCHEMA or isinstance(schema, bool):
            keys.fail("schema", expected=f"{SCHEMA}", found=schema)
        version = keys.whole("version", 0, 1, 1_000_000)
        if not version:
            keys.fail("version", expected="a whole number from 1", found="none")
        table, policies, bounds = keys.table("captures"), keys.marks("policies"), keys.table("tolerances")
        keys.finish()
        # They become names of folders.
        for key, names in (("captures", tuple(table.values)), ("policies", policies)):
            if strange := [name for name in names if not (isinstance(name, str) and _NAME.fullmatch(name))]:
                keys.fail(key, expected="names of small letters, digits and _", found=repr(strange[0]))
        return cls(
            path,
            version,
            {name: _capture(name, table.table(name)) for name in table.values},
            tuple(map(str, policies)),
            {name: bounds.number(name, 0.0, 1e6) or 0.0 for name in bounds.values},
        )

    def capture(self, name: str) -> Capture:
        """One of the captures; a KinemimicError names them all."""
        if name not in self.captures:
            raise KinemimicError(
                f"{self.path}: expected a capture among {', '.join(self.captures)}, found {name!r}"
            )
        return self.captures[name]


def _capture(name: str, keys: Keys) -> Capture:
    file = PurePosixPath(keys.text("file", ""))
    if not file.name or file.is_absolute() or ".." in file.parts:
        keys.fail("file", expected="a recording, from the folder that is built in", found=repr(str(file)))
    chosen = keys.choice("filter", FILTERS, FILTERS[0]) if "filter" in keys.values else None
    ankle: AnkleMode = "normal" if keys.choice("ankle", ANKLE_MODES, "neutral") == "normal" else "neutral"
    symmetric, loop = _switch(keys, "symmetric"), _switch(keys, "loop")
    refined = _switch(keys, "refined")
    keys.finish()
    return Capture(name, Path(file), chosen, symmetric, refined is not False, ankle, loop)


def _switch(keys: Keys, key: str) -> bool | None:
    value = keys.get(key)
    if value is not None and not isinstance(value, bool):
        keys.fail(key, expected="true or false", found=repr(value))
    return value
