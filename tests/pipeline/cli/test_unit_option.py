"""--unit: the length unit that the user names, in `ingest`, `inspect` and every kind of reader."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples.motion import walk
from samples.trc import files

from kinemimic.pipeline.cli import options
from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import read_clip, read_json
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.kinematics.skeleton import TRACKED
from kinemimic.pipeline.quality.check import check_capture
from kinemimic.pipeline.quality.rules.length_units import SET_BY_USER, UNIT_OPTIONS
from kinemimic.pipeline.readers.recognise import read
from kinemimic.pipeline.writers.skl import write_skl

Text = Callable[..., str]
Out = pytest.CaptureFixture[str]


def command(*arguments: str | Path) -> int:
    """Exit status of `kinemimic ...`."""
    with pytest.raises(SystemExit) as caught:
        main([str(argument) for argument in arguments])
    return int(caught.value.code or 0)


@pytest.fixture
def child(tmp_path: Path, bvh: Text) -> Path:
    """Legs of 44 cm, which could be a giant's in inches."""
    head, motion = bvh().split("MOTION")
    smaller = re.sub(
        r"OFFSET (\S+) (\S+) (\S+)",
        lambda found: "OFFSET " + " ".join(f"{float(x) * 44 / 83:.9g}" for x in found.groups()),
        head,
    )
    path = tmp_path / "child.bvh"
    path.write_text(smaller + "MOTION" + motion)
    return path


def test_the_choices_are_the_units() -> None:
    assert tuple(UNIT_OPTIONS) == options.UNITS


def test_a_named_unit_leaves_no_doubt_and_is_recorded(child: Path, tmp_path: Path) -> None:
    told = ingest(child, tmp_path / "told", unit="cm")
    report = read_json(tmp_path / "told" / "quality.json")
    assert report["units"] == {"length": "cm", "rule": SET_BY_USER}
    assert "wrong_units" not in {defect["rule"] for defect in report["defects"]}
    assert read_clip(tmp_path / "told" / "raw.parquet").provenance["config"] == {
        "filter": "kalman",
        "unit": "cm",
    }
    guessed = ingest(child, tmp_path / "guessed")
    assert np.array_equal(told.positions, guessed.positions)
    (doubt,) = read_json(tmp_path / "guessed" / "quality.json")["defects"]
    assert doubt["action"] == "flagged" and "--unit" in doubt["text"]
    giant = read(child, unit="inch")
    np.testing.assert_allclose(giant.positions, 2.54 * read(child).positions, atol=1e-12)
    assert giant.translations is not None and check_capture(giant).refused is None


@pytest.mark.parametrize(("unit", "found"), [("m", "44 m"), ("mm", "0.044 m"), ("cmu", "2.484 m")])
def test_a_unit_that_makes_no_sense_is_one_line(
    child: Path, tmp_path: Path, capsys: Out, unit: str, found: str
) -> None:
    assert command("ingest", child, "--run", tmp_path / "run", "--unit", unit) == 2
    out, error = capsys.readouterr()
    assert out == "" and len(error.strip().splitlines()) == 1
    assert f"a leg (thigh and shank) of {found} in " in error
    assert f"{SET_BY_USER}; it would be 0.44 m in cm or 1.12 m in inch" in error
    assert not (tmp_path / "run").exists()
    assert command("inspect", child, "--unit", unit) == 2
    with pytest.raises(
        KinemimicError, match="expected a unit among m, ft, dm, cmu, inch, cm, mm, found 'furlong'"
    ):
        read(child, unit="furlong")


def test_inspect_looks_in_that_unit(child: Path, capsys: Out) -> None:
    statures = []
    for unit in ("cm", "inch"):
        assert command("inspect", child, "--unit", unit, "--json") == 0
        (report,) = json.loads(capsys.readouterr().out)["files"]
        assert report["units"] == {"length": unit, "rule": SET_BY_USER}
        statures.append(report["stature_m"])
    assert statures == pytest.approx([0.90, 2.28], abs=0.01)


def test_a_header_that_lies_is_overruled(tmp_path: Path) -> None:
    true = tmp_path / "walk.trc"
    true.write_bytes(files(60)["walk.trc"])
    liar = tmp_path / "liar.trc"
    liar.write_text(true.read_text().replace("\tmm\t", "\tm\t"))
    assert np.array_equal(read(liar, unit="mm").positions, read(true).positions)
    assert read(liar, unit="mm").provenance["reading"]["units"] == "mm"


def test_a_format_with_a_unit_of_its_own_is_overruled(tmp_path: Path) -> None:
    shown = walk(60)
    path = tmp_path / "millimetres.skl"
    write_skl(
        path,
        np.round(1000.0 * shown.times).astype(np.int64),
        1000.0 * shown.joints,
        np.full(shown.joints.shape[:2], TRACKED, dtype=np.uint8),
        np.array([0.0, 1.0, 0.0, 0.9]),
    )
    assert read(path).provenance["reading"]["units"] == "m"
    told = read(path, unit="mm")
    assert told.provenance["reading"]["units"] == "mm"
    clip = check_capture(told).clip
    legs = [clip.skeleton.names.index(name) for name in ("hip_left", "knee_left")]
    thigh = np.linalg.norm(clip.positions[:, legs[0]] - clip.positions[:, legs[1]], axis=-1)
    assert 0.35 < float(np.median(thigh)) < 0.50
