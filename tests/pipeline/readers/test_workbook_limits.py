"""Excel workbooks: without a capture, too large, damaged."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest
from samples import joint_table
from samples.mutate import mutated
from samples.workbook import FRAMES, Rows, read_workbook, rows_of, saved

from kinemimic.pipeline.errors import CaptureError, KinemimicError
from kinemimic.pipeline.readers import workbook

openpyxl = pytest.importorskip("openpyxl")


@pytest.mark.parametrize(
    ("sheets", "found"),
    [
        ({"a": []}, "expected a workbook with a sheet that has cells, found none; save it as Excel Workbook"),
        ({"a": [["name", "age"]], "b": [[1, 2]]}, "expected a sheet with positions .*, found a, b"),
        ({"a": [["name", "age"], [1, 2]]}, "sheet 'a': expected a capture, found"),
        ({"a": [["#N/A"]], "b": [*[[]] * 300, [1]]}, "expected a sheet with positions .*, found a, b"),
    ],
)
def test_workbooks_without_a_capture(tmp_path: Path, sheets: dict[str, Rows], found: str) -> None:
    with pytest.raises(CaptureError, match=found):
        read_workbook(tmp_path, saved(sheets))


def replaced(content: bytes, parts: dict[str, bytes]) -> bytes:
    """The workbook with other parts, in place of those that it has, or beside them."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(buffer, "w") as new:
        for name, part in ({name: old.read(name) for name in old.namelist()} | parts).items():
            new.writestr(name, part)
    return buffer.getvalue()


def test_parts_that_unpack_to_too_much(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = saved({"a": rows_of(joint_table.files(FRAMES)["joints.csv"])})
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        types = archive.read("[Content_Types].xml")
    # A part with the name of a sheet that is declared to be something else.
    lying = types.replace(b"worksheet+xml", b"sharedStrings+xml")
    assert lying != types
    for changed, part, limit in (
        ({"xl/sharedStrings.xml": b"<sst>" * 10_001}, "xl/sharedStrings.xml", "_MAX_PART"),
        ({"xl/texts.xml": b"<sst>" * 10_001}, "xl/texts.xml", "_MAX_PART"),
        ({"[Content_Types].xml": lying}, "xl/worksheets/sheet1.xml", "_MAX_PART"),
        ({"[Content_Types].xml": types.ljust(50_001)}, "[Content_Types].xml", "_MAX_PART"),
        ({}, "xl/worksheets/sheet1.xml", "_MAX_SHEET"),
    ):
        monkeypatch.setattr(workbook, limit, 50_000)
        with pytest.raises(CaptureError, match=re.escape(f"at most 0 MB in {part}, unpacked, found 0")):
            read_workbook(tmp_path, replaced(content, changed))
        monkeypatch.undo()
    monkeypatch.setattr(workbook, "MAX_BYTES", 10_000)
    with pytest.raises(CaptureError, match="sheet 'a': expected at most 0 MB of text in a sheet, found more"):
        read_workbook(tmp_path, content)
    monkeypatch.undo()
    # A part that claims to be smaller than it is.
    size = max(part.file_size for part in zipfile.ZipFile(io.BytesIO(content)).infolist())
    lying = content.replace(size.to_bytes(4, "little"), (size // 2).to_bytes(4, "little"))
    assert lying != content
    with pytest.raises(CaptureError, match="expected a whole Excel workbook, found damage"):
        read_workbook(tmp_path, lying)


def test_a_cell_far_away_costs_no_memory(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    for row in rows_of(joint_table.files(FRAMES)["joints.csv"]):
        book.active.append(list(row))
    book.active["XFD1048576"] = 1
    buffer = io.BytesIO()
    book.save(buffer)
    with pytest.raises(CaptureError, match="expected at most 20,000,000 cells in a sheet, found more"):
        read_workbook(tmp_path, buffer.getvalue())


def test_damaged_workbooks_give_one_line(tmp_path: Path) -> None:
    content, rng = saved({"a": rows_of(joint_table.files(FRAMES)["joints.csv"])}), np.random.default_rng(2026)
    for _ in range(40):
        try:
            assert len(read_workbook(tmp_path, mutated(content, rng)).times) > 0
        except KinemimicError as error:
            assert len(str(error).splitlines()) == 1


def test_damaged_parts_give_one_line(tmp_path: Path) -> None:
    """With the right checksums, so that openpyxl meets the damage."""
    content, rng = saved({"a": rows_of(joint_table.files(FRAMES)["joints.csv"])}), np.random.default_rng(2026)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        parts = {part.filename: archive.read(part) for part in archive.infolist()}
    errors = 0
    for number in range(40):
        victim = list(parts)[number % len(parts)]
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w") as archive:
            for name, part in parts.items():
                archive.writestr(name, mutated(part, rng) if name == victim else part)
        try:
            assert len(read_workbook(tmp_path, buffer.getvalue()).times) > 0
        except KinemimicError as error:
            assert len(str(error).splitlines()) == 1
            errors += 1
    assert errors > 8


def test_without_the_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workbook.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(KinemimicError, match=r"pip install 'kinemimic\[excel\]', or save the sheet as CSV"):
        read_workbook(tmp_path, saved({"a": [[1]]}))
