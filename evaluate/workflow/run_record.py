"""run.json: the inputs and outputs of every stage of a run, so that unchanged stages are skipped."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from kinemimic.pipeline.files.provenance import versions
from kinemimic.pipeline.files.store import file_hash, read_json, write_json

RUN_SCHEMA = 1


def stage_inputs(reads: Mapping[str, Path], config: Mapping[str, Any]) -> dict[str, Any]:
    """What determines a stage's result: SHA-256 of its files (None if absent), options, version."""
    return {
        "inputs": {name: _digest(path) for name, path in reads.items()},
        "config": dict(config),
        "version": versions().get("kinemimic"),
    }


def _digest(path: Path) -> str | None:
    return file_hash(path) if path.is_file() else None


class RunRecord:
    """The entries of run.json; `record` replaces a stage's entry."""

    def __init__(self, folder: Path) -> None:
        """Read folder/run.json; a missing or malformed file, or another schema, counts as empty."""
        self._folder = folder
        self._path = folder / "run.json"
        content = read_json(self._path) if self._path.exists() else {}
        known = isinstance(content, dict) and content.get("schema") == RUN_SCHEMA
        stages = content.get("stages") if known else None
        self._stages: dict[str, Any] = stages if isinstance(stages, dict) else {}

    def up_to_date(self, stage: str, inputs: Mapping[str, Any]) -> bool:
        """Whether the stage was run on these `stage_inputs` and its output files are unchanged."""
        entry = self._stages.get(stage)
        if not isinstance(entry, dict) or not isinstance(outputs := entry.get("outputs"), dict):
            return False
        return all(entry.get(key) == value for key, value in inputs.items()) and all(
            _digest(self._folder / name) == digest for name, digest in outputs.items()
        )

    def record(self, stage: str, inputs: Mapping[str, Any], writes: Iterable[str]) -> None:
        """Enter a finished stage and its output files (None for a file that it did not write)."""
        outputs = {name: _digest(self._folder / name) for name in writes}
        self._stages[stage] = {**inputs, "outputs": outputs}
        write_json(self._path, {"schema": RUN_SCHEMA, "stages": self._stages})
