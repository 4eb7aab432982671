"""Tables whose header leaves out the axes, against the same table with them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples import marker_csv as sample
from samples import source_of

from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.joint_tables.implied_axes import with_axes

HEADER, *ROWS = sample.files(40)["vicon.csv"].decode().splitlines()
LABELS = [name.removesuffix(" (x)") for name in HEADER.split(";")[::3]]
CELLS = [row.split(";") for row in ROWS]
Spell = Callable[[str], list[str]]
SPELLINGS: dict[str, Spell] = {
    "blanks": lambda name: [name, "", ""],
    "again": lambda name: [name] * 3,
    "pandas": lambda name: [name, f"{name}.1", f"{name}.2"],
    "from 0": lambda name: [f"{name}[{k}]" for k in range(3)],
    "from 1": lambda name: [f"{name}_{k}" for k in (1, 2, 3)],
    "homogeneous": lambda name: [f"{name}[{k}]" for k in range(4)],
}


def table(spell: Spell, *, clock: bool) -> str:
    wide = len(spell("a")) == 4
    lines = [",".join([*(["time"] if clock else []), *(cell for name in LABELS for cell in spell(name))])]
    for number, cells in enumerate(CELLS):
        row = [f"{number / 100:.2f}"] if clock else []
        for k in range(0, len(cells), 3):
            row += [*cells[k : k + 3], *(["1.0"] if wide else [])]
        lines.append(",".join(row))
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("clock", [False, True])
@pytest.mark.parametrize("how", SPELLINGS)
def test_they_are_read_as_with_axes(how: str, clock: bool) -> None:
    plain = table(lambda name: [f"{name}_{axis}" for axis in "XYZ"], clock=clock)
    wanted = recognise.read_source(source_of(plain, Path("walk.csv")))
    found = recognise.read_source(source_of(table(SPELLINGS[how], clock=clock), Path("walk.csv")))
    np.testing.assert_array_equal(found.positions, wanted.positions)
    np.testing.assert_array_equal(found.times, wanted.times)


@pytest.mark.parametrize(
    "header",
    [
        ",".join(f"{name}_{axis}" for name in LABELS for axis in "xyz"),
        ",".join(f"{name}_{k}" for name in LABELS for k in (2, 3, 4)),
        ",".join(f"{name}_{k}" for name in LABELS for k in (1, 3, 2)),
        ",".join(f"{name},value,other" for name in LABELS),
        ",".join("LASI,," for _ in LABELS),
    ],
)
def test_other_headers_stay(header: str) -> None:
    source = source_of("\n".join([header, *(",".join(cells) for cells in CELLS)]) + "\n", Path("walk.csv"))
    assert with_axes(source) is source
