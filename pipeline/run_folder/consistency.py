"""Whether the files of a run folder belong together."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from pathlib import Path

from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.stages import stage_named
from kinemimic.pipeline.run_folder.record import Record, digest


class FolderState:
    """The files of a run folder against its record; each file is hashed once."""

    def __init__(self, run: Path, record: Record) -> None:
        self.run, self.record = run, record
        self._known: dict[str, str | None] = {}
        self._sound: set[str] = set()

    def sha256(self, file: str) -> str | None:
        """SHA-256 of a file of the folder, None if there is none."""
        if file not in self._known:
            self._known[file] = digest(self.run / file)
        return self._known[file]

    def require(self, files: Iterable[str]) -> None:
        """KinemimicError unless each of these files, if present, is the one that its stage wrote, from the
        files that are here now."""
        for file in files:
            self._require(file)

    def _require(self, file: str) -> None:
        stage = self.record.writer(file)
        found = self.sha256(file)
        # A file that no stage wrote here was put here on purpose; it states what it was made from itself.
        if stage is None or found is None or file in self._sound:
            return
        entry = self.record.stages[stage]
        if found != entry.outputs[file]:
            raise KinemimicError(
                f"{self.run / file}: expected the file that `{stage}` wrote here, found another; "
                f"run `{command(stage, self.run)}` again, or keep other files in a run folder of their own"
            )
        self._sound.add(file)
        for name, made_from in entry.inputs.items():
            # The file that is wrong itself, rather than those that were made from it.
            self._require(name)
            present = self.sha256(name)
            if made_from is not None and present is not None and present != made_from:
                raise KinemimicError(
                    f"{self.run / file}: expected a file made from the present {name}, found one made from "
                    f"another {name}; run `{command(stage, self.run)}` again"
                )


def command(stage: str, run: Path) -> str:
    """The command line of a stage."""
    name = stage_named(stage).name
    if name in ("virtual", "ingest"):
        return f"kinemimic ingest CAPTURE --run {shlex.quote(str(run))}"
    return f"kinemimic {stage} --run {shlex.quote(str(run))}"
