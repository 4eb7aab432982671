"""Which files of folders may be captures, and which files beside a capture may be read with it."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from kinemimic.pipeline.files.sidecars import stem_of
from kinemimic.pipeline.readers.base.frame_files import is_folder_of_frames
from kinemimic.pipeline.readers.depth.folder import is_recording

# Sidecar files of fixed names: what the markers or columns of a whole folder are, the labels of UTKinect.
_OF_THE_FOLDER = ("markers.toml", "capture.toml", "actionLabel.txt")
_HALVES = ("positions", "angles", "orientations")
_SKELETONS = (".asf", ".asf.gz")


def find_files(paths: Iterable[Path]) -> list[Path]:
    """The files at `paths`, and all files below the folders among them except hidden ones, sorted by path.

    A depth recording, which is a folder, counts as one file, and so does a folder of frames. A path that does
    not exist is kept, so that it gets a report.
    """
    found = {file: None for path in paths for file in (_files_below(path) if path.is_dir() else (path,))}
    return sorted(found, key=lambda file: file.parts)


def _files_below(folder: Path) -> Iterator[Path]:
    for place, folders, names in os.walk(folder):
        if is_recording(Path(place)) or is_folder_of_frames(Path(place)):
            folders.clear()
            yield Path(place)
            continue
        folders[:] = [name for name in folders if not name.startswith(".")]
        yield from (Path(place) / name for name in names if not name.startswith("."))


def files_to_read(capture: Path) -> dict[str, Path]:
    """Everything that reading a capture may open, by name; of a folder, by path in it.

    May list more than is read, since a reader knows what it needs only while reading. Used to send a capture
    to another machine.
    """
    if capture.is_dir():
        return {str(file.relative_to(capture)): file for file in sorted(capture.rglob("*")) if file.is_file()}
    found = {
        file.name: file for file in sorted(capture.parent.iterdir()) if _is_beside(file.name, capture.name)
    }
    return {name: file for name, file in found.items() if file.is_file()}


def _is_beside(name: str, capture: str) -> bool:
    if name == capture or name.startswith(f"{stem_of(Path(capture))}.") or name in _OF_THE_FOLDER:
        return True
    if name.lower().endswith(_SKELETONS):
        # The skeleton of NAME_01.amc is NAME.asf, or the only one in the folder.
        return capture.lower().endswith((".amc", ".amc.gz"))
    return any(capture.replace(own, other) == name for own in _HALVES if own in capture for other in _HALVES)
