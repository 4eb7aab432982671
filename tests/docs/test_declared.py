"""Every printed command exists; commands that no test runs are declared, and every declaration is used."""

from __future__ import annotations

import re
from fnmatch import fnmatchcase
from typing import Any

import click
import pytest
from click.testing import CliRunner
from printed.blocks import PAGES, Command, blocks, inline, printed
from printed.checked import check, check_names
from printed.declared import CHEAPER, CHEAPER_PYTHON, NOT_RUN, cheaper
from printed.prepared import PREPARED

from kinemimic.pipeline.catalog.command import COMMANDS as OF_DATASETS
from kinemimic.pipeline.cli.main import COMMANDS, cli

PRINTED = printed()
# bash: shown, but not run, because it needs another machine's shell, or hours.
LANGUAGES = {"sh", "bash", "python", "diff", "console", "toml", "yaml", "text", ""}


def named(commands: list[Command]) -> list[Any]:
    return [pytest.param(command, id=f"{command.place} {command.text}") for command in commands]


@pytest.mark.parametrize("command", named(PRINTED))
def test_a_printed_command_exists(command: Command) -> None:
    for words in command.parts:
        check(words)


@pytest.mark.parametrize("command", named(list(inline())))
def test_a_command_within_a_sentence_exists(command: Command) -> None:
    check_names(command.text)


@pytest.mark.parametrize("pattern", NOT_RUN)
def test_a_declaration_matches_a_command(pattern: str) -> None:
    assert any(fnmatchcase(command.text, pattern) for command in PRINTED)
    assert len(NOT_RUN[pattern]) > 10


@pytest.mark.parametrize("name", CHEAPER)
def test_a_cheaper_command_is_printed(name: str) -> None:
    touched = [command for command in PRINTED if cheaper(command.text) != command.text]
    assert any(command.text.startswith(f"kinemimic {name}") for command in touched)
    for command in touched:
        for words in command.parts:
            check(words)


@pytest.mark.parametrize("pattern", CHEAPER_PYTHON)
def test_a_cheaper_script_is_printed(pattern: str) -> None:
    scripts = [b.text for page in PAGES for b in blocks(page) if b.language == "python"]
    assert any(re.search(pattern, text) for text in scripts)


def test_cheaper_gives_an_option_the_value_of_the_table() -> None:
    costs = {"train": {"--budget": "4096"}}
    assert cheaper("kinemimic train --run a", costs) == "kinemimic train --budget 4096 --run a"
    assert cheaper("kinemimic train --run a --budget 1e6", costs) == "kinemimic train --run a --budget 4096"
    assert cheaper("kinemimic train --budget=1e6", costs) == "kinemimic train --budget 4096"
    assert cheaper("kinemimic trainer --run a", costs) == "kinemimic trainer --run a"


def test_every_page_with_commands_has_a_prepared_folder() -> None:
    doing = {
        page.name
        for page in PAGES
        if any(block.language in ("sh", "python", "diff", "console") for block in blocks(page))
    }
    assert doing == set(PREPARED)


def test_every_block_has_a_known_language() -> None:
    """No test would run a block with a misspelt `sh`."""
    assert {block.language for page in PAGES for block in blocks(page)} <= LANGUAGES


@pytest.mark.parametrize(
    "text",
    ["kinemimic nosuch", "kinemimic train --bugdet 1", "make nosuch", "make run NOSUCH=1", "curl example",
     "pip install 'kinemimic[no]'", "kinemimic train --run a | kinemimic gait --rnu b"],
)  # fmt: skip
def test_a_command_that_does_not_exist_is_found(text: str) -> None:
    with pytest.raises((AssertionError, click.ClickException)):
        for words in Command(PAGES[0], 1, text).parts:
            check(words)


@pytest.mark.parametrize("name", [*COMMANDS, *(f"datasets {name}" for name in OF_DATASETS)])
def test_every_help_shows_an_example_that_parses(name: str) -> None:
    shown = CliRunner().invoke(cli, [*name.split(), "--help"]).output.replace("\\\n", "")
    examples = re.findall(rf"^ +(kinemimic {name}\b.*)$", shown, re.MULTILINE)
    assert examples, shown
    for example in examples:
        for words in Command(PAGES[0], 1, example).parts:
            check(words)
