"""Settings of commands: kinemimic.toml, environment variables, command line."""

from __future__ import annotations

from pathlib import Path

import click
import pytest

from kinemimic.pipeline.cli.main import COMMANDS, load_command, main
from kinemimic.pipeline.cli.settings import defaults_of


@pytest.fixture
def ran(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[dict[str, object]]:
    """What a stand-in of `train` is called with."""
    calls: list[dict[str, object]] = []

    @click.command("train")
    @click.option("--budget", type=int, default=1)
    @click.option("--preset", "preset_name", default="default")
    @click.option("--resume/--no-resume", default=True)
    @click.option("--tag", "tags", multiple=True)
    @click.option("--run", type=click.Path(path_type=Path), default=Path("runs"))
    def command(**options: object) -> None:
        calls.append(options)

    real = load_command
    monkeypatch.setattr(
        "kinemimic.pipeline.cli.lazy_group.load",
        lambda where: command if where == COMMANDS["train"][0] else real(where),
    )
    monkeypatch.chdir(tmp_path)
    return calls


def call(*arguments: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(list(arguments))
    return int(ended.value.code or 0)


def test_the_command_line_comes_before_the_variable_before_the_file(
    ran: list[dict[str, object]], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("kinemimic.toml").write_text(
        '[train]\nbudget = 5\npreset = "robust"\nresume = false\ntag = ["a", "b"]\nrun = "elsewhere"\n'
    )
    assert call("train") == 0
    assert ran[-1] == {
        "budget": 5,
        "preset_name": "robust",
        "resume": False,
        "tags": ("a", "b"),
        "run": Path("elsewhere"),
    }
    monkeypatch.setenv("KINEMIMIC_TRAIN_BUDGET", "6")
    assert call("train") == 0 and ran[-1]["budget"] == 6 and ran[-1]["preset_name"] == "robust"
    assert call("train", "--budget", "7", "--resume") == 0
    assert ran[-1]["budget"] == 7 and ran[-1]["resume"] is True


def test_without_a_file_nothing_changes(ran: list[dict[str, object]]) -> None:
    assert call("train") == 0
    assert ran[-1]["budget"] == 1 and ran[-1]["resume"] is True


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("[train]\nbudgte = 5", "expected an option of `train`, found 'budgte'; did you mean 'budget'?"),
        ("[trian]\nbudget = 5", "table [trian]: expected the name of a command, found none; did you mean"),
        ("train = 5", "expected a table for a command, as in [train], found a value"),
        ("[train.budget]\nis = 5", "key budget: expected a value, found a table"),
        ("[train", "kinemimic.toml: expected TOML, found"),
        ("[train]\nbudget = 'many'", "'many' is not a valid integer"),
        ("[train]\npreset_name = 'robust'", "expected an option of `train`, found 'preset_name'"),
    ],
)
def test_a_mistake_is_one_clear_line(
    ran: list[dict[str, object]], capsys: pytest.CaptureFixture[str], text: str, found: str
) -> None:
    Path("kinemimic.toml").write_text(text)
    assert call("train") == 2
    assert found in capsys.readouterr().err and not ran


def test_commands_of_a_group_have_tables_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("kinemimic.toml").write_text("[datasets.record]\nseed = -5")
    assert call("datasets", "record", "walk", "--into", "x") == 2
    assert "-5 is not in the range" in capsys.readouterr().err
    Path("kinemimic.toml").write_text("[datasets.record]\nsede = 5")
    assert call("datasets", "record", "walk", "--into", "x") == 2
    assert "table [datasets.record]: expected an option" in capsys.readouterr().err
    Path("kinemimic.toml").unlink()
    monkeypatch.setenv("KINEMIMIC_DATASETS_RECORD_SEED", "-6")
    assert call("datasets", "record", "walk", "--into", "x") == 2
    assert "-6 is not in the range" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["ingest", "retarget", "evaluate", "run", "batch", "export"])
def test_every_option_of_a_command_can_be_set(name: str) -> None:
    command = load_command(name)
    options = [one for one in command.params if isinstance(one, click.Option)]
    for option in options:
        flag = next(flag for flag in option.opts if flag.startswith("--")).removeprefix("--")
        assert list(defaults_of(command, name, {flag: "x"})) == [option.name]


def test_variables_have_the_names_of_command_and_option(
    ran: list[dict[str, object]], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Not those of the function's parameters: --preset is preset_name there."""
    monkeypatch.setenv("KINEMIMIC_TRAIN_PRESET", "robust")
    assert call("train") == 0 and ran[-1]["preset_name"] == "robust"
    monkeypatch.setenv("KINEMIMIC_TRAIN_PRESET_NAME", "robust")
    assert call("train") == 2
    assert (
        "found KINEMIMIC_TRAIN_PRESET_NAME; did you mean 'KINEMIMIC_TRAIN_PRESET'" in capsys.readouterr().err
    )
