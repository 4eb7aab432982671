"""`datasets record`: its options reach the recording and its note; committed recordings are reproduced."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from kinemimic.pipeline.files.sidecars import note_path, read_note, read_truth, truth_path
from kinemimic.pipeline.virtual_kinect.command import command

RAW = Path(__file__).parents[3] / "datasets" / "versions" / "raw"
CAPTURES = ("kinect_walk.skl", "kinect_walk_euler.bvh", "kinect_run_euler.bvh", "kinect_walk_turning.skl")
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def _record(into: Path, *options: str) -> dict[str, object]:
    command.main(["walk", "--into", str(into), *options], standalone_mode=False)
    (path,) = into.glob("kinect_walk*.skl")
    note = read_note(note_path(path))["virtual_kinect"]
    assert isinstance(note, dict)
    return note


def test_options_are_in_the_note(tmp_path: Path) -> None:
    note = _record(tmp_path, "--speed", "1.5", "--variability", "2", "--sensor", "turning", "--seed", "5")
    config = note["config"]
    assert isinstance(config, dict)
    assert (config["speed"], config["sensor"], note["seed"]) == (1.5, "turning", 5)
    assert config["variability"]["joints"] == 2.0
    assert note["speed"] == pytest.approx(1.5, rel=0.1)


def test_without_variability_speed_and_period_are_those_of_the_cycle(tmp_path: Path) -> None:
    note = _record(tmp_path, "--variability", "0", "--speed", "1.2")
    assert note["speed"] == pytest.approx(1.2, rel=0.01)
    assert note["period"] == pytest.approx(38 * 0.033332 * (1.23859 / (38 * 0.033332) / 1.2) ** 0.5, rel=1e-3)


@pytest.mark.parametrize(("motion", "speed"), [("walk", "2.5"), ("run", "1.0")])
def test_a_speed_that_the_motion_does_not_have_is_refused(tmp_path: Path, motion: str, speed: str) -> None:
    result = CliRunner().invoke(command, [motion, "--into", str(tmp_path), "--speed", speed])
    assert result.exit_code == 2
    assert f"m/s for a {motion}, found {speed}" in result.output
    assert not any(tmp_path.iterdir())


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recorded")
    command.main(["walk", "run", "--into", str(folder)], standalone_mode=False)
    command.main(["walk", "--into", str(folder), "--sensor", "turning"], standalone_mode=False)
    return folder


@pytest.mark.parametrize("name", CAPTURES)
def test_committed_recordings_are_reproduced(recorded: Path, name: str) -> None:
    before, now = (path.read_text(encoding="utf-8") for path in (RAW / name, recorded / name))
    assert _NUMBER.sub("#", before) == _NUMBER.sub("#", now)
    one, other = (np.array(_NUMBER.findall(text), dtype=np.float64) for text in (before, now))
    # Other processors may round the last digit differently.
    np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-4)


@pytest.mark.parametrize("name", CAPTURES)
def test_committed_truth_and_notes_are_reproduced(recorded: Path, name: str) -> None:
    one, other = (read_truth(truth_path(folder / name)) for folder in (RAW, recorded))
    assert one is not None and other is not None
    for column, curve in one.items():
        np.testing.assert_allclose(curve, other[column], rtol=0.0, atol=1e-9)
    notes = [read_note(note_path(folder / name)) for folder in (RAW, recorded)]
    for note in notes:
        # Of the packages that are installed, which may be others.
        del note["virtual_kinect"]["versions"]
    assert notes[0] == notes[1]
