"""Stages of `run` that take no time, and a capture."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import click
import pytest

from kinemimic.evaluate.workflow import run as module
from kinemimic.pipeline.files.stages import stage_named
from kinemimic.pipeline.run_folder.capture import capture_files
from kinemimic.pipeline.run_folder.stage import stage

Stages = dict[str, Callable[[], None]]


@pytest.fixture
def stages(monkeypatch: pytest.MonkeyPatch) -> Stages:
    """Stand-ins for the stages: each writes, from what it reads and its options, what the real one would.

    The dictionary takes a function to call at the start of a stage.
    """
    hooks: Stages = {}

    def stand_in(name: str) -> click.Command:
        @click.command(context_settings={"ignore_unknown_options": True, "allow_extra_args": True})
        @click.option("--run", "folder", type=click.Path(path_type=Path))
        @click.option("--json", "as_json", is_flag=True)
        @click.pass_context
        def command(context: click.Context, folder: Path, as_json: bool) -> None:
            hooks.get(name, lambda: None)()
            one, sources = stage_named(name), {}
            read = [(folder / file).read_text() for file in one.reads if (folder / file).exists()]
            if name == "ingest":
                sources = capture_files(Path(context.args[0]), ["capture.toml"])
                read += [file.read_text() for file in sources.values() if file.is_file()]
            with stage(folder, name, sources=sources) as out:
                for file in one.writes:
                    (out / file).write_text(json.dumps([name, file, read, context.args]))
            click.echo(f"table of {name}")

        return command

    monkeypatch.setattr(module, "load_command", stand_in)
    monkeypatch.setattr(module, "default_start", lambda _: {})
    return hooks


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    path = tmp_path / "walk.bvh"
    path.write_text("a walk")
    return path
