"""Stage 1 through its command: the files written, and a one-line error without output for a bad file."""

from __future__ import annotations

import json
from collections.abc import Callable
from io import StringIO
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from rich.console import Console
from samples import utkinect

from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.convert import convert, read_converted
from kinemimic.pipeline.files.store import file_hash, read_clip, read_json
from kinemimic.pipeline.ingest import ingest
from kinemimic.pipeline.inspect.file_report import file_report
from kinemimic.pipeline.inspect.file_view import file_view
from kinemimic.pipeline.kinematics.angles import ANGLES
from kinemimic.pipeline.kinematics.clip import Label
from kinemimic.pipeline.readers.recognise import read

Text = Callable[..., str]


def command(*arguments: str | Path) -> int:
    """Exit status of `kinemimic ...`."""
    with pytest.raises(SystemExit) as caught:
        main([str(argument) for argument in arguments])
    return int(caught.value.code or 0)


def lines(text: str, change: Callable[[list[str]], list[str]]) -> str:
    return "\n".join(change(text.split("\n")))


NOBODY = np.zeros((40, 20), dtype=np.int64)
BAD: dict[str, Callable[[Text, Text], str | bytes | None]] = {
    "missing": lambda skl, bvh: None,
    "empty": lambda skl, bvh: "",
    "binary": lambda skl, bvh: bytes(range(256)) * 10,
    "bvh cut in its hierarchy": lambda skl, bvh: bvh()[:500],
    "bvh with nan": lambda skl, bvh: (
        lines(bvh(), lambda t: [*t[:-5], t[-5].replace("95", "nan", 1), *t[-4:]]) + "nan"
    ),
    "skl without a column": lambda skl, bvh: skl(
        columns=lambda names: [n for n in names if n != "KneeLeft_Z"]
    ),
    "skl with nobody": lambda skl, bvh: skl(states=NOBODY),
    "bvh that never moves": lambda skl, bvh: bvh(motion=np.zeros((40, 37))),
    "skl of a moment": lambda skl, bvh: skl(10),
    "prose": lambda skl, bvh: "Lorem ipsum dolor sit amet",
}


@pytest.mark.parametrize("kind", BAD)
def test_bad_input_is_one_line_status_2_and_nothing_written(
    kind: str, tmp_path: Path, skl: Text, bvh: Text, capsys: pytest.CaptureFixture[str]
) -> None:
    content = BAD[kind](skl, bvh)
    capture, run = tmp_path / "capture", tmp_path / "run"
    if content is not None:
        capture.write_bytes(content if isinstance(content, bytes) else content.encode())
    run.mkdir()
    (run / "quality.json").write_text("of an earlier capture")
    assert command("ingest", capture, "--run", run) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.strip().split("\n")) == 1
    assert err.startswith(f"kinemimic: {capture}")
    assert " expected " in err and ", found " in err
    assert [path.name for path in run.iterdir()] == ["quality.json"]
    assert (run / "quality.json").read_text() == "of an earlier capture"
    assert command("ingest", capture, "--run", tmp_path / "new") == 2
    assert not (tmp_path / "new").exists()


def test_positions_are_filtered_by_default_and_raw_is_kept(tmp_path: Path, skl: Text) -> None:
    (tmp_path / "a.skl").write_text(skl(60))
    cleaned = ingest(tmp_path / "a.skl", tmp_path / "run")
    raw = read_clip(tmp_path / "run" / "raw.parquet")
    stored = read_clip(tmp_path / "run" / "clip.parquet")
    assert np.array_equal(stored.positions, cleaned.positions)
    assert np.array_equal(raw.times, cleaned.times)
    assert not np.array_equal(raw.positions, cleaned.positions)
    assert raw.provenance["config"] == {"filter": "kalman"}
    assert raw.provenance["inputs"]["capture"] == file_hash(tmp_path / "a.skl")
    unfiltered = ingest(tmp_path / "a.skl", tmp_path / "run", filter_name="none")
    assert np.array_equal(unfiltered.positions, raw.positions)


def test_rotations_are_filtered_by_default_too(tmp_path: Path, bvh: Text) -> None:
    (tmp_path / "a.bvh").write_text(bvh())
    assert ingest(tmp_path / "a.bvh", tmp_path / "run").rotations is not None
    assert ingest(tmp_path / "a.bvh", tmp_path / "run", filter_name="none").rotations is None


def test_the_same_capture_twice_gives_the_same_bytes(tmp_path: Path, skl: Text) -> None:
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "a.skl").write_text(skl(60))
        ingest(tmp_path / folder / "a.skl", tmp_path / folder / "run")
    for name in ("raw.parquet", "clip.parquet", "quality.json"):
        first, second = (tmp_path / folder / "run" / name for folder in ("one", "two"))
        assert file_hash(first) == file_hash(second)


def test_truth_beside_the_capture_marks_it_as_simulated(tmp_path: Path, skl: Text) -> None:
    (tmp_path / "a.skl").write_text(skl(60))
    truth = tmp_path / "a.truth.parquet"
    pq.write_table(pa.table({name: [0.1] for name in ("time", "pass", *ANGLES)}), truth)
    clip = ingest(tmp_path / "a.skl", tmp_path / "run")
    assert clip.simulated
    assert read_json(tmp_path / "run" / "quality.json")["simulated"] is True
    assert file_hash(tmp_path / "run" / "truth.parquet") == file_hash(truth)
    truth.unlink()
    assert not ingest(tmp_path / "a.skl", tmp_path / "run").simulated
    assert not (tmp_path / "run" / "truth.parquet").exists()


def test_the_command_prints_a_table_or_json(
    tmp_path: Path, skl: Text, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.skl").write_text(skl(60))
    assert command("ingest", tmp_path / "a.skl", "--run", tmp_path / "run") == 0
    text = capsys.readouterr().out
    assert "a.skl: Kinect v1 .skl text, unit m" in text
    assert "knee_left" in text
    assert command("ingest", tmp_path / "a.skl", "--run", tmp_path / "run", "--json") == 0
    assert json.loads(capsys.readouterr().out) == read_json(tmp_path / "run" / "quality.json")


def test_real_recordings_are_divided_into_their_passes(captures: Path, tmp_path: Path) -> None:
    # Passes of at least half a second between the gaps of more than half a second in their time stamps.
    for name, passes in {"i1": 20, "r2": 7, "assaf_45": 6, "micha_walk": 1}.items():
        ingest(captures / "kinect1_bernstein_skl" / f"{name}.skl", tmp_path / name)
        report = read_json(tmp_path / name / "quality.json")
        assert len(report["passes"]) == passes
        assert report["complete_frames"] > 0.98 * report["frames_in_passes"]
        leg = [report["joints"][joint]["bone_m"] for joint in ("knee_left", "ankle_left")]
        assert 0.4 < leg[0] < 0.52 and 0.33 < leg[1] < 0.41


def test_a_real_recording_without_a_person(
    captures: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = captures / "kinect2_kinect2bvh"
    assert command("ingest", broken / "test.bvh", "--run", tmp_path) == 2
    assert "found every channel is zero in all 219 frames" in capsys.readouterr().err
    assert command("ingest", broken / "Girl_Blendswap5_AddRoot3.bvh", "--run", tmp_path) == 2
    assert "line 5: expected OFFSET, CHANNELS, JOINT, End Site or }, found 'ROT'" in capsys.readouterr().err
    assert command("ingest", broken / "rawtest.txt", "--run", tmp_path) == 2
    assert not list(tmp_path.iterdir())


def test_refusals_and_repairs_of_the_rules(
    captures: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = captures / "kinect1_treadmill_c3d" / "skeleton_3d_20h17m38.txt"
    assert command("ingest", bad, "--run", tmp_path / "bad") == 2
    out, err = capsys.readouterr()
    assert out == "" and len(err.strip().splitlines()) == 1
    assert "impossible limb lengths: thigh 0.32 m and shank 0.22 m" in err and "tracked something else" in err
    assert not (tmp_path / "bad").exists()
    good = captures / "kinect1_bernstein_skl" / "pd_1_c.skl"
    assert command("ingest", good, "--run", tmp_path / "good") == 0
    assert "  repaired  left and right swapped" in capsys.readouterr().out
    report = read_json(tmp_path / "good" / "quality.json")
    assert "swapped_sides" in {defect["rule"] for defect in report["defects"]}
    assert report["sidecar_files"] == {}
    recorded, raw = read(good), read_clip(tmp_path / "good" / "raw.parquet")
    # The knees may also have been exchanged while one leg hid the other.
    left, right = (raw.skeleton.names.index(f"hip_{side}") for side in ("left", "right"))
    behind = raw.passes == 0
    assert np.array_equal(raw.times, recorded.times)
    same = np.isfinite(raw.positions[behind][:, left, 0])
    assert np.array_equal(raw.positions[behind][same, left], recorded.positions[behind][same, right])


def test_labels_stay_on_the_clock_from_the_file_to_the_quaternions(tmp_path: Path) -> None:
    """The reader drops repeated frames, the cleaning none: the named times still hold the same frames."""
    for name, content in utkinect.files(48).items():
        (tmp_path / name).write_bytes(content)
    capture = tmp_path / "joints_s02_e01.txt"
    labels = (Label("walk", 200 / 60, 240 / 60), Label("sitDown", 250 / 60, 260 / 60))
    assert ingest(capture, tmp_path).labels == labels
    assert convert(tmp_path).labels == labels
    recorded = read(capture)
    raw, cleaned = (read_clip(tmp_path / f"{name}.parquet") for name in ("raw", "clip"))
    for clip in (raw, cleaned, read_converted(tmp_path)):
        assert clip.labels == labels
        assert np.array_equal(clip.times, recorded.times)
    report = file_report(capture)
    assert report["labels"] == [
        {"name": "walk", "start_s": 3.3333, "end_s": 4.0},
        {"name": "sitDown", "start_s": 4.1667, "end_s": 4.3333},
    ]
    shown = StringIO()
    Console(file=shown, width=200).print(file_view(report))
    assert "walk 3.33 to 4.00 s, sitDown 4.17 to 4.33 s" in shown.getvalue()


def test_a_pose_that_is_held_throughout_is_a_person_who_stands(tmp_path: Path, bvh: Text) -> None:
    (tmp_path / "a.bvh").write_text(bvh(motion=np.tile(np.linspace(1.0, 9.0, 37), (40, 1))))
    clip = ingest(tmp_path / "a.bvh", tmp_path / "run")
    assert (clip.passes == 0).all() and len(clip.times) == 40


def test_a_low_frame_rate_is_noted(tmp_path: Path, bvh: Text) -> None:
    for name, frame_time, notes in (("slow", "0.1", 1), ("usual", "0.0333333", 0)):
        (tmp_path / f"{name}.bvh").write_text(bvh(frame_time=frame_time))
        ingest(tmp_path / f"{name}.bvh", tmp_path / name)
        found = json.loads((tmp_path / name / "quality.json").read_text())["notes"]
        assert sum("10.0 Hz" in note for note in found) == notes
