"""Excel workbooks of any sheets, and of those that MVN exports."""

from __future__ import annotations

import csv
import importlib
import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.readers import recognise
from samples import mvnx
from samples.motion import rigid_walk

Rows = Sequence[Sequence[Any]]
FRAMES = 24


def saved(sheets: Mapping[str, Rows]) -> bytes:
    """A workbook of these sheets."""
    openpyxl = importlib.import_module("openpyxl")
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(list(row))
    buffer = io.BytesIO()
    book.save(buffer)
    return buffer.getvalue()


def typed(cell: str) -> Any:
    """A cell as a spreadsheet takes it: as a number where it is one."""
    try:
        return None if cell == "" else int(cell) if cell.isdecimal() else float(cell)
    except ValueError:
        return cell


def rows_of(content: bytes, separator: str = ",") -> Rows:
    text = content.decode("utf-8-sig")
    return [[typed(cell) for cell in row] for row in csv.reader(text.splitlines(), delimiter=separator)]


def of_mvn(rate: Any = 60.0) -> dict[str, Rows]:
    """Sheets as MVN exports them: the places are neither in the first sheet nor in the only one so named."""
    places, turns = mvnx.segments(rigid_walk(FRAMES))
    header = [
        f"{re.sub('(?<=[a-z])(?=[A-Z])', ' ', name)} {axis}" for name, *_ in mvnx.TREE for axis in "xyz"
    ]
    angles = Rotation.from_quat(turns.reshape(-1, 4)).as_euler("XYZ", degrees=True).reshape(FRAMES, -1)
    velocities = np.gradient(places, axis=0).reshape(FRAMES, -1) * mvnx.RATE
    numbers = {
        "Segment Orientation - Euler": angles,
        "Segment Velocity": velocities,
        "Segment Position": places.reshape(FRAMES, -1),
    }
    return {
        "General Information": [["MVN Version", "2023.2.0"], ["Suit Label", "walk"], ["Frame Rate", rate]],
        **{
            name: [["Frame", *header], *([k, *row] for k, row in enumerate(values.tolist()))]
            for name, values in numbers.items()
        },
    }


def read_workbook(tmp_path: Path, content: bytes) -> Clip:
    (tmp_path / "walk.xlsx").write_bytes(content)
    return recognise.read(tmp_path / "walk.xlsx")
