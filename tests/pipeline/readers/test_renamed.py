"""Captures are recognised under any name; without their header, too, or refused with helpful advice."""

from __future__ import annotations

import importlib
import importlib.util
import re
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
import samples
from samples import reader_modules

from kinemimic.pipeline.arrays import Array
from kinemimic.pipeline.errors import CaptureError
from kinemimic.pipeline.kinematics.clip import Clip
from kinemimic.pipeline.kinematics.nodes import to_nodes
from kinemimic.pipeline.kinematics.skeleton import NODE_INDEX
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.readers import recognise
from kinemimic.pipeline.readers.base.source import Source

FRAMES = 30
# These find their sidecar file by the capture's name, so it is renamed with it.
PAIRED_BY_NAME = {"custom_table": "aufnahme", "uiprmd": "kinect_m01_s01_e01", "azure_csv": "azure"}
# Helpful advice: candidate formats, or what is missing.
HELPFUL = re.compile(
    r"formats of that width: .+; restore its header, or describe its columns \(`kinemimic inspect --suggest`"
    r"|found (?:text that begins|a binary file of unknown format).*`kinemimic formats` lists the known"
    r"|line 1: expected a keyword or the first frame's number"
    r"|line \d+, column \d+: expected JSON"
    r"|line \d+: expected XML"
)


def sample(name: str) -> dict[str, bytes]:
    files: dict[str, bytes] = importlib.import_module(f"samples.{name}").files(FRAMES)
    return files


def named_anew(name: str, folder: Path) -> Path:
    """The sample's files, the capture under a name and a suffix that say nothing; sidecar files are kept."""
    capture, *sidecar_files = sample(name).items()
    stem = PAIRED_BY_NAME.get(name)
    path = folder / ("Copy (3) of x.dat" if stem is None else capture[0].replace(stem, "Copy (3) of x"))
    path.write_bytes(capture[1])
    for file, content in sidecar_files:
        (folder / (file.replace(stem, "Copy (3) of x") if stem else file)).write_bytes(content)
    return path


def test_every_reader_has_a_sample() -> None:
    assert [name for name in reader_modules() if importlib.util.find_spec(f"samples.{name}") is None] == []


@pytest.mark.parametrize("name", reader_modules())
def test_renamed(name: str, tmp_path: Path) -> None:
    clip = recognise.read(named_anew(name, tmp_path))
    assert clip.provenance["format"] == format_of(name)


def test_half_of_a_pair_whose_name_does_not_lead_to_the_other(tmp_path: Path) -> None:
    capture, content = next(iter(sample("uiprmd").items()))
    assert "positions" in capture
    (tmp_path / "x.dat").write_bytes(content)
    with pytest.raises(CaptureError, match="expected 'positions' in the name of this file"):
        recognise.read(tmp_path / "x.dat")


@pytest.mark.parametrize("name", reader_modules())
def test_without_its_header(name: str, tmp_path: Path) -> None:
    path = named_anew(name, tmp_path)
    source = Source.open(path)
    if source.is_text:
        lines = source.text.split("\n")
        path.write_text("\n".join(lines[header_lines(lines) :]))
    else:
        path.write_bytes(source.content[512:])
    if name == "custom_table":
        # The description says that the second line is a header, and there a row of data stands.
        with pytest.raises(
            CaptureError, match=r"line 2: expected a column 'Becken x', found none of that name"
        ):
            recognise.read(path)
        return
    try:
        clip = recognise.read(path)
    except CaptureError as error:
        assert HELPFUL.search(str(error)), str(error)
        assert "\n" not in str(error)
        columns = samples.reader(name).FORMAT.columns
        width = re.search(r"a table of (\d+) numbers", str(error))
        if width and int(width[1]) in columns:
            assert format_of(name) in str(error), "a table names its own format among the candidates"
    else:
        own = clip.provenance["format"] == format_of(name)
        assert own or clip.provenance["format"] in ("joint table", "joint rows")
        whole = recognise.read(named_anew(name, tmp_path))
        for joint, side in product(("hip", "knee", "ankle"), ("left", "right")):
            found, expected = (from_spine(one, f"{joint}_{side}") for one in (clip, whole))
            assert own or np.allclose(found, expected, atol=1e-3, equal_nan=True)


def from_spine(clip: Clip, node: str) -> Array:
    """Distance of a joint from the spine, which no axes change."""
    points = to_nodes(check_capture(clip).clip)[0]
    return np.linalg.norm(points[:, NODE_INDEX[node]] - points[:, NODE_INDEX["spine"]], axis=1)


def format_of(name: str) -> str:
    found: str = samples.reader(name).FORMAT.name
    return found


def header_lines(lines: list[str]) -> int:
    """Lines before two in a row that are mostly numbers; of a file without such lines, the first."""
    for number, (line, after) in enumerate(pairwise(lines)):
        if mostly_numbers(line) and mostly_numbers(after):
            return number
    return 1


def mostly_numbers(line: str) -> bool:
    fields = [field for field in re.split(r"[\s,;]+", line) if field]
    numbers = sum(
        re.fullmatch(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|nan", field, re.I) is not None
        for field in fields
    )
    return len(fields) > 2 and numbers >= 0.5 * len(fields)
