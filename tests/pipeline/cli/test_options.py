"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
import pytest
import torch
from click.testing import CliRunner

from kinemimic.pipeline.cli.main import COMMANDS, load_command
from kinemimic.pipeline.cli.options import LARGEST_SEED, out_option, run_option, seed_option
from kinemimic.pipeline.errors import KinemimicError


def test_a_run_folder_has_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    @click.command()
    @run_option(default=None)
    def command(run: Path | None) -> None:
        click.echo(str(run))

    monkeypatch.chdir(tmp_path)
    assert CliRunner().invoke(command, ["--run", "runs/a"]).output.strip() == str(Path("runs/a"))
    result = CliRunner().invoke(command, ["--run", ""])
    assert isinstance(result.exception, KinemimicError)
    assert str(result.exception) == "--run: expected the name of a run folder, found an empty one"


def test_a_file_in_place_of_a_run_folder_is_refused_by_every_command(tmp_path: Path) -> None:
    (tmp_path / "walk.skl").write_text("a walk")
    for name in COMMANDS:
        command = load_command(name)
        if any("--run" in option.opts for option in command.params):
            result = CliRunner().invoke(command, ["--run", str(tmp_path / "walk.skl")])
            assert "expected a run folder, found a file; choose another --run" in str(result.exception), name


def test_a_seed_is_one_that_every_generator_takes() -> None:
    @click.command()
    @seed_option()
    def command(seed: int) -> None:
        torch.Generator().manual_seed(seed)
        np.random.default_rng(seed)

    assert CliRunner().invoke(command, ["--seed", str(LARGEST_SEED)]).exit_code == 0
    for outside in (LARGEST_SEED + 1, 2**64, -1):
        result = CliRunner().invoke(command, ["--seed", str(outside)])
        assert result.exit_code == 2 and "--seed" in result.output


def test_all_commands_take_the_same_seeds() -> None:
    for name in COMMANDS:
        for option in load_command(name).params:
            if "--seed" in option.opts:
                assert isinstance(option.type, click.IntRange)
                assert (option.type.min, option.type.max) == (0, LARGEST_SEED), name


def test_an_output_folder_is_required_without_a_default() -> None:
    def shown(default: Path | None, *arguments: str) -> tuple[int, str]:
        @click.command()
        @out_option("Folder.", default)
        def command(out: Path) -> None:
            click.echo(out)

        result = CliRunner().invoke(command, arguments)
        return result.exit_code, result.output.strip()

    status, message = shown(None)
    assert status == 2 and "Missing option '--out'" in message
    assert shown(None, "--out", "a") == shown(Path("b"), "--out", "a") == (0, "a")
    assert shown(Path("b")) == (0, "b")


def test_jobs_have_a_short_name_in_every_command() -> None:
    for name in COMMANDS:
        for option in load_command(name).params:
            assert ("--jobs" in option.opts) == ("-j" in option.opts), name
