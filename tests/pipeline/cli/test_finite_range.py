"""Numbers of options: nan and inf are refused by every command, in one line that names the option."""

from __future__ import annotations

from pathlib import Path

import click
import pytest

from kinemimic.pipeline.catalog.command import COMMANDS as OF_DATASETS
from kinemimic.pipeline.cli.finite_range import FiniteRange
from kinemimic.pipeline.cli.lazy_group import load
from kinemimic.pipeline.cli.main import COMMANDS, main

Out = pytest.CaptureFixture[str]

WHERE = {name: where for name, (where, _) in COMMANDS.items()} | {
    f"datasets {name}": where for name, (where, _) in OF_DATASETS.items()
}


@pytest.mark.parametrize("name", WHERE)
def test_every_number_of_every_command_is_finite(name: str) -> None:
    for parameter in load(WHERE[name]).params:
        numbers = isinstance(parameter.type, click.types.FloatParamType)
        assert not numbers or isinstance(parameter.type, FiniteRange), f"{name} {parameter.opts}"


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e999"])
def test_what_is_not_finite_is_refused(value: str) -> None:
    for kind in (FiniteRange(), FiniteRange(max=1.0), FiniteRange(min=0.0, min_open=True)):
        with pytest.raises(click.BadParameter):
            kind.convert(value, None, None)


def test_a_number_in_range_stays() -> None:
    assert FiniteRange(0.0, 1.0).convert("0.25", None, None) == 0.25


@pytest.mark.parametrize(
    "arguments",
    [
        "train --minutes nan",
        "train --minutes inf",
        "batch walk.bvh --out out --timeout nan",
        "batch walk.bvh --out out --limit-memory inf",
        "library walk.bvh --out out --timeout inf",
        "stream --lag nan --replay walk.bvh --no-page --run out",
        "stream --seconds inf --replay walk.bvh --no-page --run out",
        "simulate --run out --seconds nan",
        "view --run out --video out.webm --seconds inf",
        "view --run out --screenshot out.png --at nan",
        "gallery out --at inf --picture out.png",
        "datasets record walk --into out --variability nan",
        "datasets record walk --into out --speed nan",
        "ingest walk.bvh --run out --rate nan",
        "ingest walk.mp4 --run out --fov inf",
    ],
)
def test_nan_and_inf_are_one_line_that_names_the_option(
    arguments: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Out
) -> None:
    monkeypatch.chdir(tmp_path)
    words = arguments.split()
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    last = capsys.readouterr().err.strip().splitlines()[-1]
    value = next(word for word in words if word in ("nan", "inf"))
    assert f"'{words[words.index(value) - 1]}'" in last
    assert last.endswith(f"found {value}") or value in last
    assert not [*tmp_path.iterdir()]
