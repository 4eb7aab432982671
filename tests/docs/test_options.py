"""The page of options has the help of every command, with every option."""

from __future__ import annotations

import importlib.util
import re
from types import SimpleNamespace

import click
import pytest
from printed.blocks import ROOT

from kinemimic.pipeline.catalog.command import COMMANDS as OF_DATASETS
from kinemimic.pipeline.cli.lazy_group import load
from kinemimic.pipeline.cli.main import COMMANDS

ALL = {name: where for name, (where, _) in COMMANDS.items()} | {
    f"datasets {name}": where for name, (where, _) in OF_DATASETS.items()
}


@pytest.fixture(scope="module")
def page() -> str:
    """The text of options.md as mkdocs builds it."""
    hook = ROOT / "docs" / "options_page.py"
    assert f"- {hook.relative_to(ROOT)}" in (ROOT / "mkdocs.yml").read_text()
    spec = importlib.util.spec_from_file_location("options_page", hook)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    text = (ROOT / "docs" / "options.md").read_text()
    found: str = module.on_page_markdown(text, SimpleNamespace(file=SimpleNamespace(src_uri="options.md")))
    return found


@pytest.mark.parametrize("name", ALL)
def test_a_command_has_a_section_with_its_help_and_every_option(page: str, name: str) -> None:
    section = re.search(rf"^##+ kinemimic {name}\n(.*?)(?=^##|\Z)", page, re.MULTILINE | re.DOTALL)
    assert section is not None
    shown = " ".join(section[1].split())
    command = load(ALL[name])
    context = click.Context(command)
    assert " ".join(str(command.help).replace("\b", "").split()) in shown
    # click keeps the help option of a command's first context, which may lack -h in a test.
    assert "--help Show this message and exit." in shown
    for option in command.params:
        if isinstance(option, click.Option):
            record = option.get_help_record(context)
            assert record is not None, f"{option.opts} is hidden"
            names, meaning = record
            assert option.help and " ".join(f"{names} {meaning}".split()) in shown


def test_the_page_has_no_other_commands(page: str) -> None:
    assert re.findall(r"^##+ (.+)$", page, re.MULTILINE) == [
        "kinemimic", *(f"kinemimic {name}" for name in ALL)
    ]  # fmt: skip
