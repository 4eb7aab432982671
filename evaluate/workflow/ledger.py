"""run.json: what every stage of a run was made from and what it wrote, so that nothing is done twice."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from kinemimic.pipeline.files.provenance import versions
from kinemimic.pipeline.files.store import file_hash, read_json, write_json

LEDGER_SCHEMA = 1


def made_from(reads: Mapping[str, Path], config: Mapping[str, Any]) -> dict[str, Any]:
    """What decides a stage's result: SHA-256 of its inputs (None if absent), options, version."""
    return {
        "inputs": {name: _digest(path) for name, path in reads.items()},
        "config": dict(config),
        "version": versions().get("kinemimic"),
    }


def _digest(path: Path) -> str | None:
    return file_hash(path) if path.is_file() else None


class Ledger:
    """The entries of a run folder; each is kept until `record` replaces it."""

    def __init__(self, folder: Path) -> None:
        """Read folder/run.json; what is missing, of another schema or no entry at all counts as not there."""
        self._folder = folder
        self._path = folder / "run.json"
        content = read_json(self._path) if self._path.exists() else {}
        known = isinstance(content, dict) and content.get("schema") == LEDGER_SCHEMA
        stages = content.get("stages") if known else None
        self._stages: dict[str, Any] = stages if isinstance(stages, dict) else {}

    def up_to_date(self, stage: str, source: Mapping[str, Any]) -> bool:
        """True if the stage was made from `source` and its files are still those that it wrote."""
        entry = self._stages.get(stage)
        if not isinstance(entry, dict) or not isinstance(outputs := entry.get("outputs"), dict):
            return False
        return all(entry.get(key) == value for key, value in source.items()) and all(
            _digest(self._folder / name) == digest for name, digest in outputs.items()
        )

    def record(self, stage: str, source: Mapping[str, Any], writes: Iterable[str]) -> None:
        """Enter a finished stage and its files in the run folder (None for one it did not write)."""
        outputs = {name: _digest(self._folder / name) for name in writes}
        self._stages[stage] = {**source, "outputs": outputs}
        write_json(self._path, {"schema": LEDGER_SCHEMA, "stages": self._stages})
