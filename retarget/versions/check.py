"""`kinemimic datasets check`: verifies that raw data are as locked and still build the locked outputs."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path

import click

from kinemimic.pipeline.cli.options import json_option
from kinemimic.pipeline.cli.printable import echo
from kinemimic.pipeline.cli.progress import progress
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.canonical import Canonical
from kinemimic.retarget.versions.build import LAST_STAGE, STAGES, build_capture, built_path
from kinemimic.retarget.versions.diff import describe, find_changes
from kinemimic.retarget.versions.manifest import (
    MANIFEST,
    Manifest,
    changed_raw,
    differing_names,
    missing_changelog_line,
)
from kinemimic.retarget.versions.params import Params, params_option

EXIT_WRONG = 1  # exit status
_MAX_CHANGES = 3  # listed per file


def check(params: Params, root: Path, against: str | None = None) -> list[str]:
    """A line for each fault; none if the data set matches its manifest.

    If raw files differ, only they are listed. against: a commit whose manifest must be equal if it has the
    same version.
    """
    path = root / params.path.parent / MANIFEST
    manifest = Manifest.load(path)
    if wrong := list(changed_raw(params, manifest, root)):
        return wrong
    if manifest.version != params.version:
        wrong.append(
            f"{path}: expected version {params.version}, as in {params.path}, found {manifest.version}; "
            "run `make data`"
        )
    if (missing := missing_changelog_line(params.version, root)) is not None:
        wrong.append(missing)
    if against is not None:
        wrong += _since(against, params, manifest, root)
    wrong += _outputs(params, manifest, root)
    return wrong


def _since(commit: str, params: Params, manifest: Manifest, root: Path) -> Iterator[str]:
    """A line if a commit has different data under the same or a later version."""
    path = (root / params.path.parent / MANIFEST).resolve()
    if not path.is_relative_to(root.resolve()):
        raise KinemimicError(f"--against: expected {path} below {root.resolve()}, found it elsewhere")
    name = path.relative_to(root.resolve()).as_posix()
    there = _git(root, "ls-tree", "--name-only", "--end-of-options", commit, name)
    if there is None:
        raise KinemimicError(f"--against: expected a commit, found {commit!r}")
    if not there.strip():
        # The commit predates the manifest.
        return
    try:
        content = json.loads(_git(root, "show", f"{commit}:./{name}") or "")
    except ValueError as error:
        raise KinemimicError(f"{commit}:{name}: expected JSON, found {error}") from None
    before = Manifest.of_json(content, f"{commit}:{name}")
    if before != manifest and before.version >= manifest.version:
        yield (
            f"{name}: expected the data of version {before.version}, as at {commit}, found that "
            f"{', '.join(differing_names(before, manifest)) or 'the version'} changed; raise `version` in "
            f"{params.path}"
        )


def _git(root: Path, *arguments: str) -> str | None:
    """Git's output, None if it fails."""
    command = ["git", *arguments]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)  # noqa: S603 (no shell)
    return done.stdout if done.returncode == 0 else None


def _outputs(params: Params, manifest: Manifest, root: Path) -> Iterator[str]:
    """A line for each output that differs from the manifest, stored or built today."""
    expected = {name.split("/")[0] for name in manifest.content}
    for name in sorted(expected ^ params.captures.keys()):
        yield f"{params.path}: expected the captures of the manifest, found another: {name}; run `make data`"
    with progress("check", len(params.captures), unit="captures") as bar:
        for name, capture in params.captures.items():
            for file, fresh in build_capture(capture, root).items():
                wanted = manifest.content.get(f"{name}/{file}")
                there = built_path(params, root, name, file)
                try:
                    if (line := _output(there, fresh, wanted, needed=file == STAGES[LAST_STAGE])) is not None:
                        yield line
                except KinemimicError as error:
                    yield f"{error}; `make data` rebuilds it"
            bar.advance(1.0)


def _output(path: Path, fresh: Canonical, wanted: str | None, *, needed: bool) -> str | None:
    """The fault of one output, or None.

    fresh: built today; wanted: identity as locked; needed: whether the file must exist (committed files must,
    those in dvc's remote need not).
    """
    if not path.exists() and needed:
        return f"{path}: expected the committed file, found none; `make data` builds it"
    stored = Canonical.read(path) if path.exists() else None
    if fresh.identity == wanted:
        if stored is None or stored.identity == wanted:
            return None
        changed = _describe_changes(fresh, stored)
        return f"{path}: expected the locked data, found {changed}; `make data` rebuilds it"
    line = f"{path}: expected today's code to build the locked data, found other data"
    if stored is not None and stored.identity == wanted:
        line += f": {_describe_changes(stored, fresh)}"
    elif stored is not None and stored.identity == fresh.identity:
        line += ", which are built here but not locked"
    return f"{line}; `kinemimic datasets diff` lists all; if intended, raise `version` and run `make data`"


def _describe_changes(before: Canonical, after: Canonical) -> str:
    found = find_changes(before, after)
    more = f" and {len(found) - _MAX_CHANGES} more" if len(found) > _MAX_CHANGES else ""
    return "; ".join(describe(one) for one in found[:_MAX_CHANGES]) + more


@click.command("check")
@params_option
@click.option("--against", metavar="COMMIT", help="A commit whose data of the same version must be equal.")
@json_option("Print the faults as JSON.")
def command(path: Path, against: str | None, as_json: bool) -> None:
    """Check the data set in the current folder against its manifest.

    Compares the raw files by SHA-256, then rebuilds the outputs and compares them number by number. Prints
    one line per fault; exit status 1 if there are any.

    \b
      kinemimic datasets check --against origin/main
    """
    params = Params.load(path)
    wrong = check(params, Path(), against)
    if as_json:
        click.echo(json.dumps({"version": params.version, "wrong": wrong}, indent=2))
    else:
        for line in wrong:
            echo(f"datasets: {line}", err=True)
    if wrong:
        click.get_current_context().exit(EXIT_WRONG)
    if not as_json:
        echo(f"{path.parent / MANIFEST}: version {params.version}, all as locked")
