"""Excel workbooks: the same clip as from CSV, the right sheet of several."""

from __future__ import annotations

import importlib
import io
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import samples
from samples import azure_csv, joint_table, mvnx
from samples.motion import rigid_walk
from samples.workbook import FRAMES, of_mvn, read_workbook, rows_of, saved

from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.errors import CaptureError, NotACaptureError
from kinemimic.pipeline.readers import recognise

openpyxl = pytest.importorskip("openpyxl")


@pytest.mark.parametrize(
    ("name", "separator"),
    [
        ("joint_table", ","), ("joint_rows", ","), ("marker_csv", ","), ("mediapipe_csv", ","),
        ("azure_csv", ","), ("nexus_csv", ","), ("motive_csv", ","), ("nuitrack_csv", ","),
        ("qualisys_tsv", "\t"), ("trc", "\t"),
    ],
)  # fmt: skip
def test_a_sheet_is_read_as_the_text_of_its_cells(tmp_path: Path, name: str, separator: str) -> None:
    files = importlib.import_module(f"samples.{name}").files(FRAMES)
    for file, content in files.items():
        (tmp_path / file).write_bytes(content)
    first = next(iter(files))
    (tmp_path / "walk.xlsx").write_bytes(saved({"Sheet1": rows_of(files[first], separator)}))
    plain, clip = recognise.read(tmp_path / first), recognise.read(tmp_path / "walk.xlsx")
    assert clip.provenance["format"] == samples.reader(name).FORMAT.name
    assert np.array_equal(clip.times, plain.times)
    assert np.array_equal(clip.positions, plain.positions, equal_nan=True)
    assert "sheet 'Sheet1' of the workbook" in clip.provenance["reading"]["notes"]


@pytest.mark.parametrize(("rate", "hertz"), [(60.0, 60.0), ("60", 60.0), (240, 240.0), ("unknown", 30.0)])
def test_the_sheet_of_places_and_the_rate_of_another(tmp_path: Path, rate: Any, hertz: float) -> None:
    clip = read_workbook(tmp_path, saved(of_mvn(rate)))
    assert clip.rate == pytest.approx(hertz)
    notes = clip.provenance["reading"]["notes"]
    assert notes[0] == "sheet 'Segment Position' of the workbook"
    assert any("stated in another sheet" in note for note in notes) == (hertz != 30.0)
    places = mvnx.segments(rigid_walk(FRAMES))[0]
    k = [name for name, *_ in mvnx.TREE].index("LeftLowerLeg")
    found = clip.positions[:, clip.skeleton.names.index("knee_left")]
    assert np.allclose(np.diff(found, axis=0), np.diff(places[:, k], axis=0), atol=1e-9)


def test_two_rates_that_disagree_are_none(tmp_path: Path) -> None:
    sheets = of_mvn() | {"Video": [["frame rate", 25.0]]}
    assert read_workbook(tmp_path, saved(sheets)).rate == pytest.approx(30.0)


def test_a_rate_below_its_name(tmp_path: Path) -> None:
    sheets = of_mvn() | {"General Information": [["Subject", "Frame Rate"], ["A", 120]]}
    assert read_workbook(tmp_path, saved(sheets)).rate == pytest.approx(120.0)


@pytest.mark.parametrize("clock", ["datetime", "time", "timedelta"])
def test_cells_of_times(tmp_path: Path, clock: str) -> None:
    header, *rows = rows_of(joint_table.files(FRAMES)["joints.csv"])
    start = datetime(2026, 3, 1, 9, 30)
    times = [start + timedelta(milliseconds=round(float(row[0]))) for row in rows]
    cells: list[Any] = [one.time() if clock == "time" else one for one in times]
    if clock == "timedelta":
        cells = [one - start for one in times]
    clip = read_workbook(
        tmp_path,
        saved({"a": [["time", *header[1:]], *([c, *row[1:]] for c, row in zip(cells, rows, strict=True))]}),
    )
    expected = [(one - times[0]).total_seconds() for one in times]
    assert clip.times - clip.times[0] == pytest.approx(expected, abs=1e-3)


def test_a_rate_with_its_unit_and_one_of_another_device(tmp_path: Path) -> None:
    sheets = of_mvn() | {"General Information": [["Frame Rate (Hz)", "120 Hz"]]}
    sheets |= {"EMG": [["frame rate", 1000.0]], "Notes": [["sampling rate", 500.0]]}
    assert read_workbook(tmp_path, saved(sheets)).rate == pytest.approx(120.0)


def test_a_column_of_rates_is_none(tmp_path: Path) -> None:
    sheets = of_mvn() | {"General Information": [["frame", "fps"], *([k, 27.4 + k % 3] for k in range(9))]}
    assert read_workbook(tmp_path, saved(sheets)).rate == pytest.approx(30.0)


def test_a_long_sheet_is_read_to_its_end(tmp_path: Path) -> None:
    rows = rows_of(joint_table.files(300)["joints.csv"])
    assert len(read_workbook(tmp_path, saved({"a": rows})).times) == 300


def test_cells_that_only_look_empty(tmp_path: Path) -> None:
    """Bold ones above, beside and below the table, as they stay when their text is deleted."""
    rows = rows_of(joint_table.files(FRAMES)["joints.csv"])
    plain = read_workbook(tmp_path, saved({"a": rows}))
    book = openpyxl.load_workbook(io.BytesIO(saved({"a": [[], *rows]})))
    sheet = book["a"]
    for row, column in ((1, 1), (15, 100), (FRAMES + 9, 3), (60_000, 1)):
        sheet.cell(row, column).font = openpyxl.styles.Font(bold=True)
    sheet.cell(18, 99).value = ""
    buffer = io.BytesIO()
    book.save(buffer)
    clip = read_workbook(tmp_path, buffer.getvalue())
    assert np.array_equal(clip.positions, plain.positions)
    assert clip.provenance["reading"]["notes"] == plain.provenance["reading"]["notes"]


def test_a_remark_beside_the_table(tmp_path: Path) -> None:
    rows = [list(row) for row in rows_of(joint_table.files(FRAMES)["joints.csv"])]
    rows[7] += [None, "he turned here"]
    assert len(read_workbook(tmp_path, saved({"a": rows})).times) == FRAMES


def test_errors_of_cells_are_missing_values(tmp_path: Path) -> None:
    rows = [list(row) for row in rows_of(joint_table.files(FRAMES)["joints.csv"])]
    head = rows[0].index("Head.x")
    rows[6][head : head + 3] = ["#N/A", "#DIV/0!", "#VALUE!"]
    clip = read_workbook(tmp_path, saved({"a": rows}))
    assert np.isnan(clip.positions[:, clip.skeleton.names.index("head")]).any(axis=1).nonzero()[
        0
    ].tolist() == [5]


def test_a_damaged_sheet_of_places_is_not_made_up_for_by_another(tmp_path: Path) -> None:
    sheets = of_mvn()
    rows = [list(row) for row in sheets["Segment Position"]]
    rows[5][0] = "x"
    with pytest.raises(CaptureError, match=r"sheet 'Segment Position', line 6: expected a time, found none"):
        read_workbook(tmp_path, saved({**sheets, "Segment Position": rows}))


@pytest.mark.parametrize("kept", ["Segment Velocity", "Segment Orientation - Euler"])
def test_no_places_at_all(tmp_path: Path, kept: str) -> None:
    sheets = {name: rows for name, rows in of_mvn().items() if name in ("General Information", kept)}
    with pytest.raises(NotACaptureError, match=f"expected a sheet with positions of .* Information, {kept}"):
        read_workbook(tmp_path, saved(sheets))


def test_what_is_wrong_in_a_known_format_is_not_read_as_another(tmp_path: Path) -> None:
    rows = [list(row) for row in rows_of(azure_csv.files(FRAMES)["azure_positions.csv"], ";")]
    rows[6][rows[0].index("PELVIS (c)")] = 9
    with pytest.raises(CaptureError, match="sheet 'a', line 7: expected a confidence"):
        read_workbook(tmp_path, saved({"a": rows}))


def test_the_other_half_of_a_pair_may_be_a_workbook_too(tmp_path: Path) -> None:
    for name, content in azure_csv.files(FRAMES).items():
        (tmp_path / name).with_suffix(".xlsx").write_bytes(saved({"a": rows_of(content, ";")}))
    clip = recognise.read(tmp_path / "azure_positions.xlsx")
    assert any("no file of orientations" in note for note in clip.provenance["reading"]["notes"])


def test_the_message_names_the_sheet_and_the_row(tmp_path: Path) -> None:
    rows = [list(row) for row in rows_of(joint_table.files(FRAMES)["joints.csv"])]
    rows[9][0] = "later"
    with pytest.raises(
        CaptureError, match=r"walk.xlsx, sheet 'a', line 10: expected a time, found none; see"
    ):
        read_workbook(tmp_path, saved({"a": rows}))


def test_a_description_is_drafted_for_a_sheet_and_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "walk.xlsx").write_bytes(saved(of_mvn()))
    with pytest.raises(SystemExit) as ended:
        main(["inspect", "--suggest", str(tmp_path / "walk.xlsx")])
    assert ended.value.code == 0
    printed = capsys.readouterr()
    assert "needs no description: it is read as joint table" in printed.err
    (tmp_path / "walk.toml").write_text(printed.out)
    clip = recognise.read(tmp_path / "walk.xlsx")
    assert clip.provenance["format"] == "custom table"
    assert clip.provenance["sidecar_files"].keys() == {"walk.toml"}


def test_a_description_is_drafted_for_the_table_beside_other_sheets(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    header, *rows = rows_of(joint_table.files(FRAMES)["joints.csv"])
    unknown = [[f"column {k}" for k in range(len(header))], *rows]
    (tmp_path / "walk.xlsx").write_bytes(saved({"Info": [["Subject", "A"]], "Data": unknown}))
    with pytest.raises(SystemExit) as ended:
        main(["inspect", "--suggest", str(tmp_path / "walk.xlsx")])
    assert ended.value.code == 0
    assert "Draft for walk.xlsx" in capsys.readouterr().out
