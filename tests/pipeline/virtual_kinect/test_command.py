"""`datasets record`: its options reach the recording, and its note."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from kinemimic.pipeline.files.sidecars import note_path, read_note
from kinemimic.pipeline.virtual_kinect.command import command


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
