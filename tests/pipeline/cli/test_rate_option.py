"""--rate: the frame rate that the user gives, in `ingest` and `inspect`, for every kind of reader."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from samples import utkinect

from kinemimic.pipeline.cli import options
from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import read_clip, read_json
from kinemimic.pipeline.kinematics.clip import Clip, Label
from kinemimic.pipeline.readers.clocks.frame_rate import HIGHEST, LOWEST, at_rate
from kinemimic.pipeline.readers.recognise import read

Text = Callable[..., str]
Build = Callable[..., Clip]
Out = pytest.CaptureFixture[str]


def command(*arguments: str | Path) -> int:
    """Exit status of `kinemimic ...`."""
    with pytest.raises(SystemExit) as caught:
        main([str(argument) for argument in arguments])
    return int(caught.value.code or 0)


def test_the_limits_are_those_of_the_reader() -> None:
    assert (LOWEST, HIGHEST) == options.RATES


def test_ingest_applies_and_records_the_rate(tmp_path: Path, bvh: Text) -> None:
    path = tmp_path / "walk.bvh"
    path.write_text(bvh())
    declared = read(path)
    assert command("ingest", path, "--run", tmp_path / "run", "--rate", "50") == 0
    raw = read_clip(tmp_path / "run" / "raw.parquet")
    assert np.allclose(np.diff(raw.times), 1.0 / 50.0)
    assert np.array_equal(raw.positions, declared.positions)
    assert raw.provenance["config"] == {"filter": "kalman", "rate": 50.0}
    assert raw.provenance["reading"]["rate_hz"] == 50.0
    report = read_json(tmp_path / "run" / "quality.json")
    assert report["clock"]["rate_hz"] == 50.0
    assert f"set by --rate; by the file's clock {declared.rate:.4g}" in " ".join(report["notes"])


def test_inspect_looks_at_that_rate(tmp_path: Path, bvh: Text, capsys: Out) -> None:
    path = tmp_path / "walk.bvh"
    path.write_text(bvh())
    rates = {}
    for rate in ("30", "60"):
        command("inspect", path, "--rate", rate, "--json")
        (report,) = json.loads(capsys.readouterr().out)["files"]
        rates[rate] = (report["rate_hz"], report["duration_s"])
    assert (rates["30"][0], rates["60"][0]) == (30.0, 60.0)
    assert rates["30"][1] == pytest.approx(2.0 * rates["60"][1], abs=0.002)


def test_labels_stay_at_their_frames(tmp_path: Path) -> None:
    for name, content in utkinect.files(48).items():
        (tmp_path / name).write_bytes(content)
    path = tmp_path / "joints_s02_e01.txt"
    before, after = read(path), read(path, rate=7.5)
    assert after.rate == pytest.approx(7.5)
    assert len(before.labels) == 2
    for old, new in zip(before.labels, after.labels, strict=True):
        inside = [(c.times >= one.start) & (c.times <= one.end) for c, one in ((before, old), (after, new))]
        assert inside[0].any() and np.array_equal(*inside)


def test_dropped_frames_stay_dropped(node_clip: Build) -> None:
    whole = replace(node_clip(30), provenance={"reading": {"notes": [], "defects": []}})
    times = whole.times.copy()
    times[20:] += 2.0 / 30.0
    clip = at_rate(replace(whole, times=times, labels=(Label("walk", 0.1, 0.2),)), 60.0)
    assert clip.times[20] - clip.times[19] == pytest.approx(3.0 / 60.0)
    assert clip.times[1] - clip.times[0] == pytest.approx(1.0 / 60.0)
    assert clip.labels[0].end == pytest.approx(0.1)


@pytest.mark.parametrize("rate", [0.0, -5.0, 1e6, float("nan")])
def test_a_rate_that_makes_no_sense_is_one_line(tmp_path: Path, bvh: Text, capsys: Out, rate: float) -> None:
    path = tmp_path / "walk.bvh"
    path.write_text(bvh())
    with pytest.raises(KinemimicError, match="expected a frame rate of 1 to 1000 Hz, found"):
        read(path, rate=rate)
    assert command("ingest", path, "--run", tmp_path / "run", f"--rate={rate}") == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert "rate" in error and "1000" in error
    assert not (tmp_path / "run").exists()
