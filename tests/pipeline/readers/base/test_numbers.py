"""Tables of numbers: Arrow and numpy give the same values, line numbers and errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples import source_of

from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.readers.base import numbers
from kinemimic.pipeline.readers.base.numbers import parse_sparse_table, parse_table

PATH = Path("table.txt")


def rows(count: int, width: int = 7) -> list[str]:
    values = np.random.default_rng(5).normal(scale=100.0, size=(count, width))
    return [" ".join(f"{value:.15g}" for value in row) for row in values]


@pytest.fixture(params=["quick", "slow"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Every table by Arrow where it can, or none."""
    monkeypatch.setattr(numbers, "_LARGE", 0 if request.param == "quick" else 2**40)
    name: str = request.param
    return name


@pytest.mark.parametrize("separator", [None, "\t", ",", ";"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_every_number_is_as_python_reads_it(way: str, separator: str | None, end: str) -> None:
    lines = ["a header", "", *rows(50), "", *rows(3), "  "]
    if separator:
        lines = [line.replace(" ", separator) if line[:1] != "a" else line for line in lines[:-1]]
    source = source_of(end.join(lines) + end, PATH)
    table = parse_table(source, start=1, separator=separator)
    split = [line.split(separator) for line in lines[1:] if line.strip()]
    assert table.values.tolist() == [[float(field) for field in fields] for fields in split]
    # The last row follows the second blank line.
    assert table.line(0) == 3
    assert table.line(52) == 56


def test_a_trailing_separator_is_accepted(way: str) -> None:
    source = source_of("1,2,3,\n4,5,6,\n", PATH)
    assert parse_table(source, separator=",").values.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert parse_table(source, separator=",", width=3).values.shape == (2, 3)


def test_lines_of_another_width_are_dropped_and_counted(way: str) -> None:
    source = source_of("0 0\n1 2 3\n\n4 5\n6 7 8 9\n7 8 9\n", PATH)
    table = parse_table(source, width=3, drop_other_widths=True)
    assert table.values.tolist() == [[1, 2, 3], [7, 8, 9]]
    assert table.dropped == 3
    assert [table.line(row) for row in range(2)] == [2, 6]


def test_other_white_space_does_not_change_the_width(way: str) -> None:
    source = source_of("1 2 3\n4  5 6\n7 8\n 7 8 9\n", PATH)
    table = parse_table(source, width=3, drop_other_widths=True)
    assert table.values.tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    assert table.dropped == 1


def test_label_columns_are_skipped(way: str) -> None:
    table = parse_table(source_of("a;1;2\n\nb1;3;4;\n", PATH), separator=";", label_columns=1, width=3)
    assert table.values.tolist() == [[1, 2], [3, 4]]
    with pytest.raises(CaptureError, match="line 2: expected 3 numbers, found 4"):
        parse_table(source_of("a;1;2\nb;3;4;5\n", PATH), separator=";", label_columns=1, width=3)
    with pytest.raises(CaptureError, match="line 2: expected a number, found 'x'"):
        parse_table(source_of("a;1;2\nb;3;x\n", PATH), separator=";", label_columns=1, width=3)


def test_non_finite_numbers_pass(way: str) -> None:
    values = parse_table(source_of("1 nan -inf\n1e999 NaN inf\n", PATH)).values
    assert np.array_equal(values, [[1, np.nan, -np.inf], [np.inf, np.nan, np.inf]], equal_nan=True)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("1 2\n3 4\n5\n", "line 3: expected 2 numbers, found 1; the file is cut off there"),
        ("1 2\n3 4 5\n5 6\n", "line 2: expected 2 numbers, found 3; mend or delete that line$"),
        ("1 2\n\n3 x4\n", "line 3: expected a number, found 'x4'"),
        ("1 2\n3 1_000\n", "line 2: expected a number, found '1_000'"),
        ("1 2\n3 0x10\n", "line 2: expected a number, found '0x10'"),
        ('1 2\n3 "4"\n', "line 2: expected a number"),
        ("1 2\n3 4\u00b0\n", "line 2: expected a number"),
        ("1 2\nx y\n3 4\n", "line 2: expected a number, found 'x'; two files seem to be joined there"),
        ("1 2\nHIERARCHY\n3 4\n", "line 2: expected 2 numbers, found 1; two files seem to be joined there"),
    ],
)
def test_mistakes_name_their_line(way: str, text: str, complaint: str) -> None:
    with pytest.raises(CaptureError, match=complaint):
        parse_table(source_of(text, PATH))


def test_white_space_in_any_layout(way: str) -> None:
    source = source_of("  1  2\t3\n4 5 6   \n\t7 8 9\n", PATH)
    assert parse_table(source).values.tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]


def test_a_table_with_no_lines(way: str) -> None:
    with pytest.raises(CaptureError, match="line 2: expected lines of numbers, found none"):
        parse_table(source_of("header\n\n\n", PATH), start=1)


@pytest.mark.parametrize("separator", [",", "\t"])
def test_an_empty_row_is_a_row_where_its_place_is_its_time(way: str, separator: str) -> None:
    text = "a,b\n,\n1,2\n\n,\n3,\n,\n,\n".replace(",", separator)
    source = source_of(text, PATH)
    skipped = parse_sparse_table(source, start=1, width=2, separator=separator)
    assert np.array_equal(skipped.values, [[1, 2], [3, np.nan]], equal_nan=True)
    kept = parse_sparse_table(source, start=1, width=2, separator=separator, keep_empty_rows=True)
    gap = [np.nan, np.nan]
    assert np.array_equal(kept.values, [gap, [1, 2], gap, [3, np.nan]], equal_nan=True)
    assert [kept.line(row) for row in range(4)] == [2, 3, 5, 6]


def test_decimal_commas(way: str) -> None:
    source = source_of("x, y;z\n-1,5;,25e-1\n2;;\n", PATH)
    values = parse_sparse_table(source, start=1, width=2, separator=";").values
    assert np.array_equal(values, [[-1.5, 2.5e-2], [2, np.nan]], equal_nan=True)
    for thousands in ("1,234.5", "1,234,567"):
        with pytest.raises(CaptureError, match=f"line 1: expected a number, found '{thousands}'"):
            parse_sparse_table(source_of(f"{thousands};2\n", PATH), start=0, width=2, separator=";")
