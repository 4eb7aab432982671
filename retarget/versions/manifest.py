"""The manifest of a data set's version: hashes of its raw files and of the outputs built from them."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.canonical import Canonical
from kinemimic.pipeline.files.store import file_hash, read_json, write_json
from kinemimic.pipeline.files.validation.schema import upgraded
from kinemimic.retarget.versions.build import STAGES, built_path
from kinemimic.retarget.versions.params import Params, params_option

_ADVICE = "; restore the file, or raise `version` and run `make data`"
MANIFEST, CHANGELOG = "manifest.json", Path("CHANGELOG.md")
SCHEMA = 1


@dataclass(frozen=True)
class Manifest:
    """version: of the data set; raw: file -> SHA-256; content: CAPTURE/FILE -> `Canonical.identity`."""

    version: int
    raw: Mapping[str, str]
    content: Mapping[str, str]

    @classmethod
    def of_json(cls, value: Any, name: str) -> Manifest:
        """name: its origin, for messages."""
        document = upgraded(
            value if isinstance(value, dict) else {},
            Path(name),
            kind="a manifest",
            schema=SCHEMA,
            advice="`make data` rewrites it",
        )
        kinds = {"version": int, "raw": dict, "content": dict}
        if wrong := [key for key, kind in kinds.items() if type(document.get(key)) is not kind]:
            raise KinemimicError(f"{name}: expected version, raw and content, found no valid {wrong[0]!r}")
        return cls(document["version"], document["raw"], document["content"])

    @classmethod
    def load(cls, path: Path) -> Manifest:
        """Raises KinemimicError for any other file."""
        if not path.exists():
            raise KinemimicError(f"{path}: expected a manifest, found no file; `make data` writes it")
        return cls.of_json(read_json(path), str(path))

    def to_json(self) -> dict[str, Any]:
        """The JSON value, deterministic."""
        return {
            "schema": SCHEMA,
            "version": self.version,
            "raw": dict(sorted(self.raw.items())),
            "content": dict(sorted(self.content.items())),
        }


def raw_hashes(params: Params, root: Path) -> dict[str, str]:
    """SHA-256 of every file in the folders of the recordings, sidecar files included."""
    folders = sorted({capture.file.parent for capture in params.captures.values()})
    files = [
        path.relative_to(root)
        for folder in folders
        for path in sorted((root / folder).glob("*"))
        if path.is_file() and not path.name.startswith(".")
    ]
    return {file.as_posix(): file_hash(root / file) for file in files}


def changed_raw(params: Params, manifest: Manifest, root: Path) -> Iterator[str]:
    """A line for each raw file that differs from the manifest."""
    found = raw_hashes(params, root)
    for file in sorted(manifest.raw.keys() | found.keys()):
        if file not in found:
            yield f"{file}: expected the raw file of version {manifest.version}, found none{_ADVICE}"
        elif file not in manifest.raw:
            yield f"{file}: expected only the raw files of version {manifest.version}, found another{_ADVICE}"
        elif found[file] != manifest.raw[file]:
            yield f"{file}: expected SHA-256 {manifest.raw[file][:12]}…, found {found[file][:12]}…{_ADVICE}"


def lock(params: Params, root: Path) -> Manifest:
    """Write the manifest of the data set that is built below `root`.

    KinemimicError unless everything is built, or if the data differ from a manifest of the same version: a
    version must always mean the same data.
    """
    path = root / params.path.parent / MANIFEST
    content: dict[str, str] = {}
    for name, capture in params.captures.items():
        if not (root / capture.file).is_file():
            raise KinemimicError(f"{capture.file}: expected the recording of {name}, found none")
        for file in STAGES.values():
            there = built_path(params, root, name, file)
            if not there.exists():
                raise KinemimicError(f"{there}: expected the output of `datasets build {name}`, found none")
            content[f"{name}/{file}"] = Canonical.read(there).identity
    made = Manifest(params.version, raw_hashes(params, root), content)
    if path.exists() and (before := Manifest.load(path)) != made and before.version >= made.version:
        raise KinemimicError(
            f"{path}: expected the data of version {before.version}, found changes in "
            f"{', '.join(differing_names(before, made))}; raise `version` in {params.path} to "
            f"{before.version + 1} and describe the change in {CHANGELOG}"
        )
    if (missing := missing_changelog_line(params.version, root)) is not None:
        raise KinemimicError(missing)
    write_json(path, made.to_json())
    return made


def differing_names(before: Manifest, after: Manifest) -> list[str]:
    """Names of the raw files and outputs that differ between two manifests."""
    return [
        name
        for one, other in ((before.raw, after.raw), (before.content, after.content))
        for name in sorted(one.keys() | other.keys())
        if one.get(name) != other.get(name)
    ]


def missing_changelog_line(version: int, root: Path) -> str | None:
    """A message if the changelog has no line on a version of the data, otherwise None."""
    path, mark = root / CHANGELOG, f"- Data {version}: "
    if path.exists() and re.search(rf"^{mark}\S", path.read_text(encoding="utf-8"), re.MULTILINE):
        return None
    return f"{path}: expected a line that starts with {mark!r} and describes the change, found none"


@click.command("lock")
@params_option
@json_option("Print the manifest.")
def command(path: Path, as_json: bool) -> None:
    """Write the manifest of the data set that is built in the current folder.

    Fails if the data changed but their version did not, or if the changelog has no line about the version.

    \b
      kinemimic datasets lock
    """
    made = lock(Params.load(path), Path())
    if as_json:
        click.echo(json.dumps(made.to_json(), indent=2))
        return
    click.echo(f"{path.parent / MANIFEST}: version {made.version}, {len(made.raw)} raw files, "
               f"{len(made.content)} built")  # fmt: skip
