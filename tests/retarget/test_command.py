"""The `retarget` stage: its files in a run folder."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from samples.converted import write_converted
from samples.walker import along
from samples.walker import walker as straight_walk

from kinemimic.pipeline.cli.main import main
from kinemimic.pipeline.convert import convert, read_converted
from kinemimic.pipeline.errors import KinemimicError
from kinemimic.pipeline.files.store import read_json, write_clip
from kinemimic.pipeline.gait.curve_metrics import r2
from kinemimic.pipeline.ingest import ingest
from kinemimic.retarget.command import command, retarget
from kinemimic.retarget.feet.zero_moment_point import Balance
from kinemimic.retarget.formats.motion_json import read_motion_json
from kinemimic.retarget.gate import check_report
from kinemimic.retarget.humanoid.motion import angles_at, joint_angles
from kinemimic.retarget.table import refusals, table

FILES = ("motion.json", "motion.mcap", "gait.json", "capture.parquet")


@pytest.fixture
def run(tmp_path, walker):
    """A run folder as after `convert`, with a truth: a noisy sensor that sees four passes."""
    w = walker(noise=0.008, passes=4, rate=30.0, seconds=2.6, heading=0.8)
    write_converted(tmp_path, w.clip)
    write_clip(tmp_path / "raw.parquet", w.clip)
    clean = walker(passes=4, rate=30.0, seconds=2.6, heading=0.8)
    phase = np.concatenate([np.arange(78) / 30 / w.period + 0.3 * k for k in range(4)])
    begin = 0.0
    truth = clean.curves(phase + begin)
    columns = {"time": w.clip.times, "pass": w.clip.passes, **truth}
    pq.write_table(pa.table(columns), tmp_path / "truth.parquet")
    return tmp_path


def test_writes_what_the_next_stages_read(run):
    motion = retarget(run)
    assert all((run / name).exists() for name in FILES)
    assert not list(run.glob(".*"))
    read = read_motion_json(run / "motion.json")
    assert read.rotations == pytest.approx(motion.rotations, abs=1e-6)
    report = json.loads((run / "gait.json").read_text())
    assert report["kind"] == "walk" and report["cyclic"]
    assert report["cadence_steps_per_min"] == pytest.approx(120 / 1.1, rel=0.01)
    assert [row["used"] for row in report["bouts"]] == [True] * 4
    assert 0.8 * 4 * 2.6 / 1.1 < report["strides_used"] <= report["strides_found"] < 4 * 2.7 / 1.1
    assert report["symmetric"]  # the sides differ by less than the noise


def test_the_same_input_gives_the_same_bytes(run):
    retarget(run)
    first = {name: (run / name).read_bytes() for name in ("motion.json", "gait.json")}
    retarget(run)
    assert first == {name: (run / name).read_bytes() for name in first}


def test_balance_displaces_the_root_of_a_depth_sensors_walk_alone(run):
    plain = retarget(run)
    assert read_json(run / "gait.json")["balance"] is None
    moved = retarget(run, balance=True)
    balance = read_json(run / "gait.json")["balance"]
    assert balance["outside_m"] < balance["outside_before_m"]
    assert "zero-moment point" in "\n".join(table(read_json(run / "gait.json")))
    assert np.abs(moved.root - plain.root).max() > 0.002
    # What the sensor saw of knees and hips stays.
    for name, curve in joint_angles(moved.rotations).items():
        assert np.degrees(np.abs(curve - joint_angles(plain.rotations)[name])).mean() < 5.0


def test_an_optical_walk_is_not_displaced(tmp_path, walker):
    write_converted(tmp_path, walker(passes=2, rate=60.0, seconds=4.0).clip)
    write_clip(tmp_path / "raw.parquet", walker(passes=2, rate=60.0, seconds=4.0).clip)
    plain = retarget(tmp_path)
    assert read_json(tmp_path / "gait.json")["reliability"]["precise"]
    assert retarget(tmp_path, balance=True).identity == plain.identity


def test_a_walk_that_balance_would_spoil_stays_as_it_is(run, monkeypatch):
    plain = retarget(run)
    stiff = np.tile([0.0, 0.0, 0.0, 1.0], (len(plain.rotations), 20, 1))
    monkeypatch.setattr(
        "kinemimic.retarget.optimise.balance_loop.balanced",
        lambda motion: (replace(motion, rotations=stiff), Balance(0.0, 10.0, 0.05)),
    )
    assert retarget(run, balance=True).identity == plain.identity


def test_captured_rows_have_the_phase_of_the_motion(run):
    motion = retarget(run)
    table = pq.read_table(run / "capture.parquet")
    table = table.filter(table["used"])
    columns = {name: table[name].to_numpy() for name in table.column_names}
    reference = angles_at(motion, columns["phase"])
    for name, curve in joint_angles(motion.rotations).items():
        # As read, with the noise of the sensor.
        assert r2(columns[name], reference[name]) > 0.75
        assert r2(columns[f"clean_{name}"], reference[name]) > 0.8
        # Frame k of the motion is phase k / T.
        assert angles_at(motion, np.array([3 / len(curve)]))[name] == pytest.approx(curve[3])
        assert f"truth_{name}" in columns
    assert set(columns["pass"]) == {0, 1, 2, 3}


def test_raw_gaps_stay_gaps(run, walker):
    clip = walker(noise=0.008, passes=4, rate=30.0, seconds=2.6, heading=0.8).clip
    holes = clip.positions.copy()
    holes[30:34, :] = np.nan
    write_clip(run / "raw.parquet", replace(clip, positions=holes))
    retarget(run)
    table = pq.read_table(run / "capture.parquet")
    lost = np.isnan(table["knee_left"].to_numpy())
    assert lost.sum() == 4
    assert np.isfinite(table["clean_knee_left"].to_numpy()[lost]).all()


def test_a_command_prints_a_table_or_json(run):
    printed = CliRunner().invoke(command, ["--run", str(run)])
    assert printed.exit_code == 0 and "cadence" in printed.output
    as_json = CliRunner().invoke(command, ["--run", str(run), "--json", "--as-recorded"])
    assert json.loads(as_json.output)["symmetric"] is False


def test_the_table_marks_findings_that_train_refuses(run):
    retarget(run)
    report = json.loads((run / "gait.json").read_text())
    assert "✗" not in "\n".join(table(report))
    (finding,) = check_report({**report, "range_deg": {name: [0.0, 20.0] for name in report["range_deg"]}})
    told = {**report, "gate": [asdict(finding)], "warnings": ["it limps", finding.message]}
    lines = table(told)
    assert lines[-3:-1] == ["  ! it limps", "  ✗ peak knee flexion of 20° (limit 35°)"]
    assert "--anyway" in lines[-1]


def test_the_refinement_is_measured_before_and_after_and_can_be_left_out(run):
    printed = CliRunner().invoke(command, ["--run", str(run)])
    report = json.loads((run / "gait.json").read_text())
    before, after = report["closed_form"], report["measures"]
    assert after["foot_speed_m_s"] < 0.5 * before["foot_speed_m_s"] and after["penetration_m"] < 0.005
    assert after["beyond_limits_deg"] == {}
    assert 0.0 < after["node_error_m"] < 0.1
    assert (
        f"{100 * before['foot_speed_m_s']:.1f} → {100 * after['foot_speed_m_s']:.1f} cm/s" in printed.output
    )
    closed = CliRunner().invoke(command, ["--run", str(run), "--no-refine", "--json"])
    plain = json.loads(closed.output)
    assert plain["closed_form"] == plain["measures"] == before


def test_nothing_is_written_if_a_loop_is_asked_of_no_walk(run, walker):
    clip = walker(rate=30.0).clip
    swap = np.random.default_rng(1).random(len(clip.times)) < 0.5
    p = clip.positions.copy()
    p[np.ix_(swap, [14, 18])] = p[np.ix_(swap, [18, 14])]
    write_converted(run, replace(clip, positions=p))
    write_clip(run / "raw.parquet", replace(clip, positions=p))
    with pytest.raises(KinemimicError, match="expected strides for --loop"):
        retarget(run, loop=True)
    assert not any((run / name).exists() for name in FILES)


@pytest.mark.parametrize(
    ("name", "cadence", "knee_peak", "r2_hip"),
    [
        # Counted in the recording: 2.6 strides of 1.105 s; the AMC knee of the same take peaks at 73 degrees.
        ("cmu_bvh/02_01.bvh", 108.6, (70, 75), 0.98),
        # Of its left leg, which the other one hides, two thirds of a stride are guessed and left out.
        ("kinect1_bernstein_skl/micha_walk.skl", 107.0, (35, 60), 0.8),
    ],
)
def test_real_walks(captures, tmp_path, name, cadence, knee_peak, r2_hip):
    ingest(captures / name, tmp_path)
    convert(tmp_path)
    retarget(tmp_path)
    report = json.loads((tmp_path / "gait.json").read_text())
    assert report["cadence_steps_per_min"] == pytest.approx(cadence, rel=0.03)
    for side in ("left", "right"):
        low, high = report["range_deg"][f"knee_{side}"]
        assert low > -3 and knee_peak[0] < high < knee_peak[1]
        assert report["r2_loop_against_capture"][f"hip_{side}"] > r2_hip
    ground = report["ground"]
    assert max(ground["penetration_m"], ground["floating_m"]) < 0.025
    assert ground["slip_m_s"] < 0.15 and ground["swing_clearance_m"] > 0


def test_a_walk_can_be_kept_as_recorded(run):
    kept = CliRunner().invoke(command, ["--run", str(run), "--no-loop", "--json"])
    report = json.loads(kept.output)
    assert report["kind"] == "walk" and not report["cyclic"]
    assert report["duration_s"] == pytest.approx(2.6, abs=0.1)
    assert report["strides_used"] == pytest.approx(2.6 / 1.1, abs=0.3)
    assert report["cadence_steps_per_min"] == pytest.approx(120 / 1.1, rel=0.05)
    assert not read_motion_json(run / "motion.json").cyclic
    captured = pq.read_table(run / "capture.parquet")
    assert len(set(captured["pass"].to_pylist())) == 1
    assert "strides in" in "\n".join(table(report))


def test_the_loop_option_needs_a_walk(run):
    clip = read_converted(run)
    still = replace(clip, positions=np.repeat(clip.positions[:1], len(clip.times), axis=0))
    write_converted(run, still)
    with pytest.raises(KinemimicError, match="expected strides for --loop, found no walk of"):
        retarget(run, loop=True)


@pytest.fixture
def curved(tmp_path):
    """A run folder of a sensor's walk on a curve: 8 s, 86 degrees to the left."""
    w = straight_walk(seconds=8.0, rate=30.0, noise=0.008)
    clip = along(w.clip, np.radians(86.0) * w.clip.times / w.clip.times[-1])
    write_converted(tmp_path, clip)
    write_clip(tmp_path / "raw.parquet", clip)
    return tmp_path


def test_a_curve_keeps_its_turn_unless_it_is_straightened(curved):
    as_recorded = retarget(curved, straighten=False)
    report = json.loads((curved / "gait.json").read_text())
    assert not as_recorded.cyclic
    assert report["turn_deg"] == pytest.approx(86.0, abs=6.0)
    way = np.diff(as_recorded.root[[0, 40, -40, -1], :2], axis=0)[[0, 2]]
    first, last = np.degrees(np.arctan2(way[:, 1], way[:, 0]))
    assert last - first == pytest.approx(86.0, abs=15.0)  # between the middles of its first and last second
    straight = retarget(curved, loop=False, straighten=True)
    report = json.loads((curved / "gait.json").read_text())
    assert not straight.cyclic and report["turn_deg"] == 0.0
    assert np.ptp(straight.root[:, 1]) < 0.03 * np.ptp(straight.root[:, 0])
    assert np.ptp(straight.root[:, 0]) == pytest.approx(report["speed_m_s"] * report["duration_s"], rel=0.02)


def test_a_loop_of_a_curve_walks_straight_and_cannot_keep_its_turn(curved):
    loop = retarget(curved)
    assert loop.cyclic and loop.cycle_offset[1] == 0.0
    with pytest.raises(KinemimicError, match="--straighten"):
        retarget(curved, loop=True, straighten=False)


def test_a_segment_by_name_or_times_becomes_the_motion(run):
    for wanted, pass_number in (("walk-3", 2), ("0-2.6", 0)):
        done = CliRunner().invoke(command, ["--run", str(run), "--segment", wanted, "--json"])
        assert done.exit_code == 0, done.output
        assert {row["pass"] for row in json.loads(done.output)["bouts"]} == {pass_number}


def test_an_unknown_segment_gives_one_line_with_the_names_and_writes_nothing(run, capsys):
    with pytest.raises(SystemExit) as caught:
        main(["retarget", "--run", str(run), "--segment", "walk-9"])
    assert caught.value.code == 2
    told = capsys.readouterr().err.strip()
    assert "\n" not in told and "found 'walk-9'" in told
    assert all(f"walk-{k} (" in told for k in range(1, 5))
    assert not any((run / name).exists() for name in FILES)


def test_a_short_walk_that_makes_no_loop_is_kept_as_recorded(captures, tmp_path):
    """One second of crouched walking in place: its loop would slip."""
    ingest(captures / "lab_opensim_gait" / "Intro_to_Musculoskeletal_Modeling__crouch1.mot", tmp_path)
    convert(tmp_path)
    motion = retarget(tmp_path)
    report = read_json(tmp_path / "gait.json")
    assert not motion.cyclic and report["kind"] == "walk"
    assert "make no loop" in report["warnings"][0] and not refusals(report)
    assert retarget(tmp_path, loop=True).cyclic
