"""The capture of a run folder: one only, unless the user says otherwise."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from pathlib import Path

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.sidecars import beside, note_path, stem_of, truth_path
from kinemimic.pipeline.files.stages import STAGES
from kinemimic.pipeline.run_folder.record import digest, read_run_record

RUNS = Path("runs")
DEFAULT_RUN = RUNS / "default"


def capture_files(capture: Path, sidecar_files: Iterable[str] = ()) -> dict[str, Path]:
    """The capture and the files that are read with it, by name; those with fixed names need not exist.

    sidecar_files: names of others. For a folder (a depth recording): every file in it.
    """
    if capture.is_dir():
        return {str(file.relative_to(capture)): file for file in sorted(capture.rglob("*")) if file.is_file()}
    read_with_it = {name: beside(capture, name) for name in sidecar_files}
    return {
        capture.name: capture,
        **read_with_it,
        "truth.parquet": truth_path(capture),
        "provenance.json": note_path(capture),
    }


def sources_of(run: Path, capture: Path) -> dict[str, Path]:
    """The files that `ingest` of this capture depends on, as far as the last `ingest` found them."""
    entry = read_run_record(run).stages.get("ingest")
    # Those of another capture say nothing about this one.
    known = entry.sources if entry is not None and capture.name in entry.sources else ()
    return capture_files(capture, known)


def require_same_capture(run: Path, capture: Path) -> None:
    """KinemimicError if the run folder has the results of another capture, or of one that is not recorded.

    A capture inside the folder, which the virtual Kinect records there, is known by its name.
    """
    entry = read_run_record(run).stages.get("ingest")
    inside = capture.resolve().is_relative_to(run.resolve())
    if entry is not None:
        same = (
            capture.name in entry.sources
            if inside
            else {digest(file) for file in _recording(capture)} <= set(entry.sources.values())
        )
        held = f"those of {next(iter(entry.sources), 'another')}"
    else:
        same = not any((run / file).is_file() for stage in STAGES for file in stage.writes if stage.reads)
        held = "those of an unknown capture, or of an earlier version"
    if not same and (inside or capture.exists()):
        raise KinemimicError(
            f"{run}: expected an empty run folder or the results of {capture.name}, found {held}; choose "
            "another --run, or add --overwrite to set them aside"
        )


def default_run(capture: Path | None) -> Path:
    """The run folder of a capture if none is given: named after the capture."""
    if capture is None:
        return DEFAULT_RUN
    capture = capture.resolve()
    return RUNS / (capture.name if capture.is_dir() else stem_of(capture))


def only_run() -> Path:
    """The only run folder in RUNS; KinemimicError if there are several, or none."""
    known = {file for stage in STAGES for file in stage.writes} | {"run.json"}
    found = sorted(
        folder for folder in RUNS.glob("*") if any((folder / file).is_file() for file in sorted(known))
    )
    if len(found) == 1:
        return found[0]
    if not found:
        raise KinemimicError(
            f"{RUNS}: expected a run folder, found none; run `kinemimic run` or `kinemimic ingest CAPTURE`, "
            "or choose one with --run"
        )
    shown = ", ".join(map(str, found[:5])) + (" …" if len(found) > 5 else "")
    raise KinemimicError(f"{RUNS}: expected --run with one of its {len(found)} run folders: {shown}")


def run_flag(run: Path) -> str:
    """ " --run DIR" for the commands that a message advises, or "" if they take this folder by default."""
    try:
        default = only_run().resolve()
    except KinemimicError:
        default = None
    return "" if run.resolve() == default else f" --run {shlex.quote(str(run))}"


def _recording(capture: Path) -> list[Path]:
    """The files of the capture itself."""
    return [*capture_files(capture).values()] if capture.is_dir() else [capture]
