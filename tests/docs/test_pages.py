"""Follow every page like its reader: run its commands and scripts and apply its changes, in order."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from peers.wheels import elsewhere, install_beside
from printed.blocks import PAGES, ROOT, Block, blocks
from printed.prepared import PREPARED, nothing
from printed.reading import Reader, environment

TUTORIAL = "tutorial.md"
# Pages that simulate nothing and need no finished run.
QUICK = {"batch.md", "describe-your-columns.md", "formats.md", "pushes.md", "tables.md"}
DONE = {"sh", "python", "diff", "console"}


def pages() -> list[Any]:
    return [
        pytest.param(page, id=page.name, marks=[] if page.name in QUICK else [pytest.mark.slow])
        for page in PAGES
        if page.name != TUTORIAL and any(block.language in DONE for block in blocks(page))
    ]


def follow(page: Path, reader: Reader) -> None:
    for block in blocks(page):
        reader.follow(block)


@pytest.mark.parametrize("page", pages())
def test_a_page_does_what_it_says(page: Path, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    prepare = PREPARED[page.name]
    if page.name not in QUICK and prepare is not nothing:
        prepare(tmp_path, request.getfixturevalue("workshop"))
    else:
        prepare(tmp_path, tmp_path)
    follow(page, Reader(tmp_path, environment()))


def test_printed_output_is_compared(tmp_path: Path) -> None:
    """The width of the lines does not matter; `…` matches anything."""
    page, reader = PAGES[0], Reader(tmp_path, environment())
    reader.follow(Block(page, 1, "sh", "", "echo 'joint   tracked %'\necho 'head 96.9'\necho 'foot 84.2'\n"))
    reader.follow(Block(page, 2, "text", "", "joint  tracked %\n…\nfoot        84.2\n"))
    for wrong in ("joint  tracked %\nfoot  84.2\n", "foot  84.2\n…\nhead  96.9\n"):
        with pytest.raises(AssertionError):
            reader.follow(Block(page, 3, "text", "", wrong))


@pytest.mark.slow
def test_the_tutorial_from_the_wheel_in_an_empty_folder(wheel: Path, tmp_path: Path) -> None:
    here, programs = tmp_path / "here", install_beside(wheel, tmp_path / "venv")
    here.mkdir()
    env = environment(programs, elsewhere())
    reader = Reader(here, env)
    where = reader.said("python -c 'import kinemimic.pipeline.ingest as m; print(m.__file__)'")
    assert where.startswith(str(tmp_path / "venv"))
    follow(ROOT / "docs" / TUTORIAL, reader)
    for name in (
        "motion.json",
        "report.html",
        "view.rrd",
        "gait_report.html",
        "export/onnx/walk-policy.onnx",
    ):
        assert (here / "runs/walk" / name).is_file()
    assert "SIMULATED" in reader.said("kinemimic export --run runs/walk --what reference --format csv")
